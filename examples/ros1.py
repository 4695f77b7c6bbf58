"""A Gestalt swarm for ROS 1: its gestures and decisions as topics, an instructor's words taken from one.

    sudo apt install python3-rospy python3-std-msgs python3-venv
    python3 -m venv --system-site-packages venv && . venv/bin/activate && pip install eclipse-zenoh
    python3 ros1.py _connect:=tcp/127.0.0.1:7447 _swarm:=gestalt

Publishes ~gesture (latched) and ~decision; takes the words open, right, wrong, undo and "was three" on ~say.
What they mean is in ros_words.py, beside it.
"""

import json

import rospy
import zenoh
from std_msgs.msg import String

from ros_words import Last, instruction


def main():
    rospy.init_node("gestalt")
    name = rospy.get_param("~swarm", "gestalt")
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([rospy.get_param("~connect", "tcp/127.0.0.1:7447")]))
    gesture = rospy.Publisher("~gesture", String, queue_size=1, latch=True)
    decision = rospy.Publisher("~decision", String, queue_size=10)
    # The last decision, and the round of which something was said last.
    last, spoken = Last(), None
    with zenoh.open(config) as swarm:

        def on_decision(sample):
            text = sample.payload.to_string()
            # All that is needed of it, or nothing: what lacks it is no decision.
            is_news = last.hear(json.loads(text))
            decision.publish(text)
            if is_news and last.decision["label"] is not None:
                gesture.publish(last.decision["label"])

        def on_word(message):
            nonlocal spoken
            try:
                word = instruction(message.data, last.decision, spoken)
            except ValueError as refused:
                return rospy.logwarn(str(refused))
            spoken = word.get("round", spoken)
            swarm.put(f"gestalt/{name}/instructor/ros/feedback", json.dumps(word))

        key = f"gestalt/{name}/decision"
        subscriber = swarm.declare_subscriber(key, on_decision)
        # What was decided before: each robot answers with the last that it knows.
        for reply in swarm.get(key, consolidation=zenoh.ConsolidationMode.NONE, timeout=2.0):
            if reply.ok is not None:
                on_decision(reply.ok)
        rospy.Subscriber("~say", String, on_word)
        rospy.spin()
        subscriber.undeclare()


if __name__ == "__main__":
    main()
