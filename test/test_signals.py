"""Signals that come at any moment of an end do not break it."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from processes import LIMIT

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


LOST = """
import sys
from ctcbs_ros.nodes import predictor
try:
    predictor._stop(2, None)
except SystemExit:
    pass  # as in a callback of compiled code, or an import that goes on
sys.argv = ["predictor", "--ros-args", "--params-file", sys.argv[1]]
sys.exit(predictor._run())
"""


def test_a_signal_in_the_nodes_start_whose_exit_is_lost_ends_it_all_the_same():
    parameters = Path(__file__).parents[1] / "config" / "small_drone.yaml"
    command = [sys.executable, "-c", LOST, str(parameters)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0
    assert "ready" not in done.stdout + done.stderr
