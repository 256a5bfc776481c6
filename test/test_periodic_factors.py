"""Factors of a periodic motion's matrices: kept in memory that is used again."""

import numpy as np
import pytest
from points import STRETCHED, parameters

from ctcbs_ros.periodic.elements import DEGREE
from ctcbs_ros.periodic.factors import Storage, bytes_needed
from ctcbs_ros.periodic.newton import newton_steps
from ctcbs_ros.periodic.solve import Effort, followed_search, motion_search
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.steady_state import steady_states

PATH, BESIDE = TowPath(GROUND_SPEED, 0.1), TowPath(GROUND_SPEED, 0.11)
EFFORT = Effort(1e-4)


def solved(storage):
    (state,) = steady_states(parameters(STRETCHED)).states
    return drained(motion_search(state, PATH, EFFORT, storage)).motion


@pytest.mark.parametrize("size", [8000, 4_000_000], ids=["too small", "large enough"])
def test_a_motion_is_the_same_in_memory_used_again_as_in_new_one(size):
    found, new = solved(Storage(size, 5)), solved(None)
    assert np.array_equal(found.values, new.values)


def test_factors_serve_nearby_until_others_are_made_in_their_memory():
    storage = Storage(4_000_000, 5)
    motion = solved(storage)
    assert not motion.factors.lost
    p, guess = motion.parameters, motion.values
    near = drained(newton_steps(p, BESIDE, guess, motion.factors, storage))
    assert near.steps == 0
    other = drained(newton_steps(p, BESIDE, guess, storage=storage))
    assert other.steps > 0
    assert motion.factors.lost
    # What is not there any more is made again, not used.
    again = drained(followed_search(motion, p, BESIDE, storage=storage)).motion
    assert again.values == pytest.approx(near.values, abs=1e-8)


def test_factors_take_the_memory_that_is_said_and_no_more():
    motion = solved(None)
    count, _, functions = motion.values.shape
    size = bytes_needed(count, functions // DEGREE)
    for given, fits in ((size, True), (size - 8, False)):
        storage, pieces = Storage(given, 3), []
        take = storage.array
        storage.array = lambda *shape, take=take, pieces=pieces: (
            pieces.append(take(*shape)) or pieces[-1]
        )
        drained(newton_steps(motion.parameters, BESIDE, motion.values, storage=storage))
        assert all(np.shares_memory(piece, pieces[0].base) for piece in pieces) == fits
