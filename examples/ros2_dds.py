"""A Gestalt swarm for ROS 2 over DDS: what `gestalt ros` does for rmw_zenoh, as a node of rclpy.

    pip install eclipse-zenoh
    python3 ros2_dds.py --connect tcp/127.0.0.1:7447 --swarm gestalt

Publishes /gestalt/gesture (latched) and /gestalt/decision; takes the words open, right, wrong and "was three" on /gestalt/say.
"""

import argparse
import json

import rclpy
import zenoh
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String


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
    last = {}
    with zenoh.open(config) as swarm:

        def on_decision(sample):
            text = sample.payload.to_string()
            last.update(json.loads(text))
            decision.publish(String(data=text))
            if last["label"] is not None:
                gesture.publish(String(data=last["label"]))

        def on_word(message):
            word, *rest = message.data.split()
            say = {"say": word}
            if word != "open":
                if not last:
                    return node.get_logger().warning("no round has been decided yet: say 'open'")
                say["round"] = last["round"]
                say |= {"class": rest[0]} if word == "was" and rest else {"of": last["class"]}
            swarm.put(f"gestalt/{options.swarm}/instructor/ros/feedback", json.dumps(say))

        subscriber = swarm.declare_subscriber(f"gestalt/{options.swarm}/decision", on_decision)
        node.create_subscription(String, "~/say", on_word, 10)
        try:
            rclpy.spin(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        subscriber.undeclare()


if __name__ == "__main__":
    main()
