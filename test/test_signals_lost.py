"""A signal that comes where an exception is lost ends the program all the same."""

import contextlib
import gc
import signal
import sys
import weakref

import pytest
from processes import wait_for

from ctcbs_ros import signals


class Ended(Exception):
    pass


@pytest.fixture(autouse=True)
def complaints(monkeypatch):
    """SIGUSR1 ends; yields what Python complains of that was raised in vain."""
    found = []
    monkeypatch.setattr(sys, "unraisablehook", found.append)
    numbers = (*signals.ENDING, signal.SIGUSR1, signal.SIGALRM)
    before = {number: signal.getsignal(number) for number in numbers}
    signal.signal(signal.SIGUSR1, lambda _, frame: signals.end_by(Ended, frame))
    yield found
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number, handler in before.items():
        signal.signal(number, handler)


def wait_for_the_end():
    wait_for(lambda: False)


def test_amid_a_finalizer_it_is_handled_after_it(complaints):
    finished = []

    class Finalized:
        def __del__(self):
            signal.raise_signal(signal.SIGUSR1)
            finished.append(True)

    with pytest.raises(Ended):  # noqa: PT012 - it comes when the finalizer has run
        Finalized()
        gc.collect()
        wait_for_the_end()
    assert finished == [True]
    assert complaints == []


def test_amid_the_end_of_a_weak_reference_it_is_handled_after_it(complaints):
    finished = []

    class Held:
        pass

    def finish():
        signal.raise_signal(signal.SIGUSR1)
        finished.append(True)

    held = Held()
    weakref.finalize(held, finish)
    with pytest.raises(Ended):  # noqa: PT012
        del held
        gc.collect()
        wait_for_the_end()
    assert finished == [True]
    assert complaints == []


def test_swallowed_it_is_raised_again(complaints):
    swallowed = []

    def swallow():
        with contextlib.suppress(Ended):
            signal.raise_signal(signal.SIGUSR1)
        swallowed.append(True)

    with pytest.raises(Ended):  # noqa: PT012
        swallow()
        wait_for_the_end()
    assert swallowed == [True]
    assert complaints == []


def test_while_it_ends_the_program_it_is_not_raised_again():
    waited = []

    def end_slowly():
        try:
            signal.raise_signal(signal.SIGUSR1)
        finally:
            before = signal.getsignal(signal.SIGALRM)
            # Looked after several times meanwhile.
            for _ in range(5):
                wait_for(lambda: signal.getsignal(signal.SIGALRM) is not before)  # noqa: B023
                before = signal.getsignal(signal.SIGALRM)
                waited.append(True)

    with pytest.raises(Ended):
        end_slowly()
    assert len(waited) == 5


def test_anywhere_else_it_is_handled_at_once(complaints):
    with pytest.raises(Ended):
        signal.raise_signal(signal.SIGUSR1)
    assert complaints == []
