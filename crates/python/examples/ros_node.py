"""A node of ROS 2: it follows /joint_states and publishes where the joints are predicted to be next.

    python ros_node.py RUN            with ROS 2 (rclpy and sensor_msgs) in reach
    python ros_node.py                without: a stand-in for rclpy plays 100 messages to a small network, to try the node

Joints are matched by their names: those that the network did not learn are left out, and those that are missing in a message are stood in
for by the network's own prediction.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import scrnn

try:
    import rclpy
    from rclpy.node import Node
    from sensor_msgs.msg import JointState
except ImportError:
    rclpy = None

    class JointState:  # type: ignore[no-redef]
        """A stand-in: names and positions."""

        def __init__(self) -> None:
            self.header: Any = None
            self.name: list[str] = []
            self.position: list[float] = []

    class Node:  # type: ignore[no-redef]
        """A stand-in: what is published is kept."""

        def __init__(self, name: str) -> None:
            self.published: list[Any] = []

        def create_subscription(self, kind: Any, topic: str, call: Any, depth: int) -> None:
            """Messages are handed in by `main`."""

        def create_publisher(self, kind: Any, topic: str, depth: int) -> Any:
            """Keeps what is published."""
            return self

        def publish(self, message: Any) -> None:
            """Keeps it."""
            self.published.append(message)


class Predictor(Node):  # type: ignore[misc, unused-ignore]
    """Follows joint states with a trained network."""

    def __init__(self, net: scrnn.Network, window: int = 30, deadline: float = 8.0) -> None:
        super().__init__("scrnn_predictor")
        self.live = net.follow(window=window, deadline=deadline)
        self.known = set(net.channels)
        self.publisher = self.create_publisher(JointState, "predicted_joint_states", 10)
        self.create_subscription(JointState, "joint_states", self.sensed, 10)

    def sensed(self, message: Any) -> None:
        """Takes a message, and publishes what is predicted for the next one."""
        there = {name: value for name, value in zip(message.name, message.position) if name in self.known}
        step = self.live.observe(there)
        if step.mean is None:
            return
        answer = JointState()
        answer.header = message.header
        answer.name = list(self.live.channels)
        answer.position = step.mean.tolist()
        self.publisher.publish(answer)


def trial() -> None:
    """Tries the node without ROS."""
    print("rclpy is not installed: a stand-in plays 100 messages")
    t = np.arange(120)
    wave = np.c_[0.5 * np.sin(t / 8), 0.3 * np.cos(t / 16)]
    net = scrnn.SCTRNN(units=10, time_constant=4.0, epochs=300)
    net.fit([wave], channels=["shoulder", "elbow"], progress=False)
    node = Predictor(net)
    for shoulder, elbow in wave[:100]:
        message = JointState()
        message.name, message.position = ["gripper", "elbow", "shoulder"], [0.0, elbow, shoulder]
        node.sensed(message)
    print(f"published {len(node.published)} predictions of {', '.join(node.published[-1].name)}")


def main(arguments: list[str]) -> None:
    """Spins, or tries without ROS."""
    if rclpy is None:
        trial()
        return
    rclpy.init()
    node = Predictor(scrnn.load(arguments[0]))
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1:])
