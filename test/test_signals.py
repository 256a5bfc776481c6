"""Signals that come at any moment of an end do not break it."""

import signal
import subprocess
import sys

import pytest

HAMMERED = """
import os, signal, subprocess, sys, threading
from ctcbs_ros import signals

signals.absorb()
# Another process sends, so that signals also come amid the C code that changes their handlers.
sender = subprocess.Popen([sys.executable, "-c", '''
import os, sys
while True:
    for number in (2, 15):
        os.kill(int(sys.argv[1]), number)
''', str(os.getpid())])
try:
    for _ in range(3000):
        signals.{change}()
        for number in signals.ENDING:
            signal.signal(number, signals._nothing)
finally:
    sender.kill()
    sender.wait()
signals.ignore()
"""


@pytest.mark.parametrize("change", ["absorb", "ignore"])
def test_change_amid_a_storm_of_signals_says_nothing(change):
    done = subprocess.run(
        [sys.executable, "-c", HAMMERED.format(change=change)], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_ignored_signals_do_not_break_the_end_of_python():
    code = (
        "import atexit, os, signal\n"
        "from ctcbs_ros import signals\n"
        "class Late:\n"
        "    def __del__(self, kill=os.kill, own=os.getpid()):\n"
        "        kill(own, 2); kill(own, 15)\n"
        "signal.late = Late()\n"  # a module's values go when Python is nearly gone
        "signals.ignore()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    code = code.replace("signals.ignore()", "signals.absorb()")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode in (-signal.SIGINT, -signal.SIGTERM)  # the test sees the difference
