"""A Gestalt swarm for ROS 1: its gestures and decisions as topics, an instructor's words taken from one.

    sudo apt install python3-rospy python3-std-msgs && pip install eclipse-zenoh
    python3 ros1.py _connect:=tcp/127.0.0.1:7447 _swarm:=gestalt

Publishes ~gesture (latched) and ~decision; takes the words open, right, wrong and "was three" on ~say.
"""

import json

import rospy
import zenoh
from std_msgs.msg import String


def main():
    rospy.init_node("gestalt")
    name = rospy.get_param("~swarm", "gestalt")
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([rospy.get_param("~connect", "tcp/127.0.0.1:7447")]))
    gesture = rospy.Publisher("~gesture", String, queue_size=1, latch=True)
    decision = rospy.Publisher("~decision", String, queue_size=10)
    last = {}
    with zenoh.open(config) as swarm:

        def on_decision(sample):
            text = sample.payload.to_string()
            last.update(json.loads(text))
            decision.publish(text)
            if last["label"] is not None:
                gesture.publish(last["label"])

        def on_word(message):
            word, *rest = message.data.split()
            say = {"say": word}
            if word != "open":
                if not last:
                    return rospy.logwarn("no round has been decided yet: say 'open'")
                say["round"] = last["round"]
                say.update({"class": rest[0]} if word == "was" and rest else {"of": last["class"]})
            swarm.put(f"gestalt/{name}/instructor/ros/feedback", json.dumps(say))

        subscriber = swarm.declare_subscriber(f"gestalt/{name}/decision", on_decision)
        rospy.Subscriber("~say", String, on_word)
        rospy.spin()
        subscriber.undeclare()


if __name__ == "__main__":
    main()
