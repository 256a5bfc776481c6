"""The loop that the node runs in: it leaves nothing behind, and ends with its log."""

import gc
import sys

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node

from ctcbs_ros.nodes.predictor import spin
from ctcbs_ros.replay.through_node import free_domain

ROUNDS = 400


class Counting(Node):
    """Counts the objects of the program, some time after its start and at its end."""

    def __init__(self, context):
        super().__init__("counting", context=context, enable_rosout=False)
        self.finished = False
        self.objects = {}
        self._rounds = 0
        self.create_timer(0.001, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _tick(self):
        self._rounds += 1
        if self._rounds in (ROUNDS // 4, ROUNDS):
            gc.collect()
            self.objects[self._rounds] = len(gc.get_objects())
        self.finished = self._rounds == ROUNDS


def test_node_that_is_woken_again_and_again_keeps_no_object_of_it():
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    node = Counting(context)
    try:
        spin(node)  # returns, as the node says that it is finished
    finally:
        node.destroy_node()
        context.try_shutdown()
    early, late = node.objects.values()
    assert late - early < ROUNDS // 10


def test_node_whose_context_is_shut_down_before_it_spins_ends_without_a_word(monkeypatch):
    """As by a signal that comes when the node has just been made."""
    complaints = []
    monkeypatch.setattr(sys, "unraisablehook", complaints.append)
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    node = Counting(context)
    context.try_shutdown()
    with pytest.raises(RuntimeError):  # which the program expects once it is to end
        spin(node)
    node.destroy_node()
    gc.collect()
    assert complaints == []
