"""An end that no further signal breaks.

Who presses Ctrl-C twice, or whose supervisor sends SIGTERM after SIGINT, must not get a traceback
from amid the end. `absorb` is for a handler: the end has begun and runs on. `ignore` is for the
last thing a program does: what follows is Python's own end.
"""

import ctypes
import signal

ENDING = (signal.SIGINT, signal.SIGTERM)


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
    for number in ENDING:
        ctypes.pythonapi.PyOS_setsig(int(number), ctypes.c_void_p(int(signal.SIG_IGN)))
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)  # runs `_nothing` for what came before


def _nothing(_number, _frame) -> None:
    pass
