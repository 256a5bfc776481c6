"""An end that a signal begins, that nothing swallows, and that no further signal breaks.

Who presses Ctrl-C must not find that the program goes on, because the exception came where it is
lost; who presses it twice, or whose supervisor sends SIGTERM after SIGINT, must not get a
traceback from amid the end. `end_by` is for a handler that raises, `absorb` for the end once it
runs, `ignore` for the last thing a program does: what follows is Python's own end.
"""

import ctypes
import signal
import weakref
from collections.abc import Callable
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM)
# Called from C, which prints what they raise and goes on (LLVM may crash): finalizers, numba's
# cache amid LLVM, weak references, locks of imports.
_RAISE_IN_VAIN = ("__del__", "_raw_object_cache_notify", "_raw_object_cache_getbuffer")
_FILES_IN_VAIN = ("weakref.py", "_weakrefset.py")
_AGAIN = 0.005  # s
_LOOK = 0.05  # s


def end_by(exception: Callable[[], BaseException], frame: FrameType | None) -> None:
    """Raise an exception, for a handler: at once, or a moment later where it would be lost.

    Much code swallows what is raised in it, be it in C or by a bare `except`. Where the exception
    has gone before it came to the end, which calls `ignore`, another one is raised.

    Parameters
    ----------
    exception : callable
        Makes the exception.
    frame : frame or None
        What the signal came amid, as handlers are told.
    """
    absorb()
    within = frame
    while within is not None and not _raises_in_vain(within):
        within = within.f_back
    if within is not None:
        _call_after(_AGAIN, lambda _, frame: end_by(exception, frame))
        return
    raised = exception()
    _look_after(weakref.ref(raised), exception)
    try:
        raise raised
    finally:
        del raised  # its traceback holds this frame: else it were never gone


def _look_after(raised: weakref.ref, exception: Callable[[], BaseException]) -> None:
    def look(_number: int, frame: FrameType | None) -> None:
        if raised() is None:
            end_by(exception, frame)
        else:
            _look_after(raised, exception)

    _call_after(_LOOK, look)


def _call_after(seconds: float, handler: Callable) -> None:
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _raises_in_vain(frame: FrameType) -> bool:
    name, file = frame.f_code.co_name, frame.f_code.co_filename
    is_module_lock = name == "cb" and file == "<frozen importlib._bootstrap>"
    return name in _RAISE_IN_VAIN or file.endswith(_FILES_IN_VAIN) or is_module_lock


def absorb() -> None:
    """From here on SIGINT and SIGTERM are taken, and nothing is done about them.

    Not SIG_IGN: of two that came at once Python has yet to run the other's handler, and complains
    where it finds none ("ignored due to race condition").
    """
    for number in ENDING:
        signal.signal(number, _nothing)


def ignore() -> None:
    """From here on SIGINT and SIGTERM are ignored, also while Python ends.

    Python takes its own handlers away before it has ended, except that of an ignored signal. To
    have none pending when it learns of SIG_IGN (see `absorb`), the process ignores it before.
    """
    absorb()
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in ENDING:
        ctypes.pythonapi.PyOS_setsig(int(number), ctypes.c_void_p(int(signal.SIG_IGN)))
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)  # runs `_nothing` for what came before


def _nothing(_number, _frame) -> None:
    pass
