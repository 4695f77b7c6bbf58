"""A Gestalt swarm for ROS 2 over DDS: what `gestalt ros` does for rmw_zenoh, as a node of rclpy.

    python3 -m venv --system-site-packages venv && . venv/bin/activate && pip install eclipse-zenoh      # needs python3-venv; ROS sourced
    python3 ros2_dds.py --connect tcp/127.0.0.1:7447 --swarm gestalt

Publishes /gestalt/gesture (latched) and /gestalt/decision; takes the words open, right, wrong, undo and "was three" on /gestalt/say.
What they mean is in ros_words.py, beside it.
"""

import argparse
import json

import rclpy
import zenoh
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from ros_words import Last, instruction


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--connect", default="tcp/127.0.0.1:7447")
    options.add_argument("--swarm", default="gestalt")
    options = options.parse_args()
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([options.connect]))
    rclpy.init()
    node = rclpy.create_node("gestalt")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    gesture = node.create_publisher(String, "~/gesture", latched)
    decision = node.create_publisher(String, "~/decision", 10)
    # The last decision, and the round of which something was said last.
    last, spoken = Last(), None
    with zenoh.open(config) as swarm:

        def on_decision(sample):
            text = sample.payload.to_string()
            # All that is needed of it, or nothing: what lacks it is no decision.
            is_news = last.hear(json.loads(text))
            decision.publish(String(data=text))
            if is_news and last.decision["label"] is not None:
                gesture.publish(String(data=last.decision["label"]))

        def on_word(message):
            nonlocal spoken
            try:
                word = instruction(message.data, last.decision, spoken)
            except ValueError as refused:
                return node.get_logger().warning(str(refused))
            spoken = word.get("round", spoken)
            swarm.put(f"gestalt/{options.swarm}/instructor/ros/feedback", json.dumps(word))

        key = f"gestalt/{options.swarm}/decision"
        subscriber = swarm.declare_subscriber(key, on_decision)
        # What was decided before: each robot answers with the last that it knows.
        for reply in swarm.get(key, consolidation=zenoh.ConsolidationMode.NONE, timeout=2.0):
            if reply.ok is not None:
                on_decision(reply.ok)
        node.create_subscription(String, "~/say", on_word, 10)
        try:
            rclpy.spin(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        subscriber.undeclare()


if __name__ == "__main__":
    main()
