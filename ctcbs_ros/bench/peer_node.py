"""Peer: an empty rclpy node, started in the same way as the predictor."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


def main() -> None:
    """Say "ready" as the predictor does, and wait for the end."""
    rclpy.init()
    node = Node("empty")
    node.get_logger().info("ready")
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
