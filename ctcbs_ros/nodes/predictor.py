"""The program `predictor`: start and end of the node."""

import argparse
import signal
import sys
from contextlib import suppress
from threading import Event

from ctcbs_ros import signals
from ctcbs_ros.nodes.heap import keep_large_blocks_apart

# What a signal in the start has asked for: its SystemExit is lost where it comes amid a callback
# of compiled code, or in an import that goes on without what it could not have.
_asked_to_stop = Event()
NO_ROS = (
    "needs ROS 2 (rclpy), which is not here: source a ROS installation, "
    "or pip install 'ctcbs_ros[ros]'"
)


def main() -> int:
    """Run the node until SIGINT, SIGTERM or the end of its log.

    Returns
    -------
    int
        0, or 2 after one line on standard error where the node cannot start.
    """
    # For the time before rclpy listens, and while the table is built. (After a KeyboardInterrupt
    # amid an import Python may end with SIGINT's code though it was caught.)
    signal.signal(signal.SIGINT, _stop)
    signal.signal(signal.SIGTERM, _stop)
    keep_large_blocks_apart()
    try:
        return _run()
    finally:
        signals.ignore()


def _run() -> int:
    try:
        import rclpy
    except ImportError:
        return _refuse(NO_ROS)
    from rclpy.executors import ExternalShutdownException
    from rclpy.utilities import remove_ros_args

    from ctcbs_ros.errors import InputError
    from ctcbs_ros.nodes.arguments import FORM, check_arguments
    from ctcbs_ros.nodes.node import PredictorNode

    usage = argparse.ArgumentParser(
        "predictor",
        usage="%(prog)s --ros-args --params-file CONFIG.yaml [-p NAME:=VALUE ...]",
        description="ROS 2 node that predicts the end mass of a towed cable from telemetry.",
    )
    try:
        check_arguments(sys.argv)
        usage.parse_args(remove_ros_args(sys.argv)[1:])
        rclpy.init()
    except InputError as error:
        return _refuse(str(error))
    except RuntimeError as error:  # what rcl refuses: names, parameter files
        reason = str(error).partition(", at /")[0]  # the rest is a place in its source
        return _refuse(f"{reason}; {FORM}" if "params file" in reason else reason)
    node = None
    try:
        if not _asked_to_stop.is_set():
            node = PredictorNode()
        if not _asked_to_stop.is_set():
            spin(node)
    except InputError as error:
        return _refuse(str(error))
    except ExternalShutdownException:
        pass
    except RuntimeError:
        if rclpy.ok():  # otherwise a signal came while a message was published
            raise
    finally:
        signals.absorb()
        if node is not None:
            node.close()
            node.destroy_node()
        # rclpy's signal handler may shut down between the test and the call that are in it.
        with suppress(RuntimeError):
            rclpy.try_shutdown()
    return 0


def spin(node) -> None:
    """Run a node's callbacks until it is finished, or its context shut down.

    Not by rclpy's own loop until a future is done: that leaves a callback on the future each time
    it is woken (rclpy issue 1371), 1.2 GB in a day beside a live link.
    """
    from rclpy.executors import SingleThreadedExecutor

    class Executor(SingleThreadedExecutor):
        # Its __del__ asks for this, also where a signal shut the context down amid its __init__.
        _sigint_gc = None

    executor = Executor(context=node.context)
    executor.add_node(node)
    while node.context.ok() and not node.finished:
        executor.spin_once()


def _stop(_number, _frame) -> None:
    _asked_to_stop.set()
    signals.absorb()
    sys.exit(0)


def _refuse(reason: str) -> int:
    print(f"predictor: {reason}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
