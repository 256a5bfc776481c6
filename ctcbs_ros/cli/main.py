"""The command `ctcbs`: its subcommands, and how errors and signals end it."""

import argparse
import os
import re
import signal
import sys
from collections.abc import Iterable, Sequence
from typing import NoReturn

from ctcbs_ros import __version__, signals
from ctcbs_ros.errors import InputError


class Interrupted(KeyboardInterrupt):
    """SIGINT, as an exception of our own.

    Where a plain KeyboardInterrupt passes through an ``exec`` (dataclasses and numba use it),
    CPython ends the process by SIGINT even though the exception was caught.
    """


class Terminated(SystemExit):
    """SIGTERM, as an exception, so that nothing half done is left behind."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `ctcbs`.

    Parameters
    ----------
    arguments : sequence of str, optional
        Instead of those of the process.

    Returns
    -------
    int
        0 done; 1 failed; 2 bad input, after one line on standard error (as argparse does itself,
        by SystemExit); 130 interrupted; 141 nobody reads standard output; 143 terminated.
    """
    ours = {signal.SIGINT: _interrupt, signal.SIGTERM: _terminate}
    before = {number: signal.signal(number, handler) for number, handler in ours.items()}
    try:
        given = sys.argv[1:] if arguments is None else arguments
        parser = _parser()
        if not given:
            parser.error(f"a command is needed: {', '.join(parser.commands)}")
        args = parser.parse_args(_with_negative_values(given))
        code = args.run(args)
        sys.stdout.flush()
        return code
    except InputError as error:
        print(f"ctcbs: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        left = f", {error}" if error.args else ""  # what does not come of it
        print(f"ctcbs: interrupted{left}", file=sys.stderr)
        return 128 + signal.SIGINT
    except Terminated:
        print("ctcbs: terminated (SIGTERM)", file=sys.stderr)
        return 128 + signal.SIGTERM
    except BrokenPipeError:
        # What is left in the buffer must not be flushed into the closed pipe at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    finally:
        # Where one came, a second one must not break Python's own end either.
        if signal.getsignal(signal.SIGINT) is _interrupt:
            for number, handler in before.items():
                signal.signal(number, handler)
        else:
            signals.ignore()


class _Parser(argparse.ArgumentParser):
    """Tells wrong usage in one line, as any other bad input, instead of the whole usage."""

    commands: Iterable[str] = ()

    def parse_known_args(self, args=None, namespace=None):
        """As argparse, but what a command does not know is told by it, not by `ctcbs`."""
        namespace, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return namespace, unknown

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message}; see {self.prog} --help\n")


def _with_negative_values(arguments: Sequence[str]) -> list[str]:
    """`--option -5%` as `--option=-5%`: argparse would take the value for another option."""
    joined: list[str] = []
    for argument in arguments:
        before = joined[-1] if joined else ""
        if re.match(r"-\.?\d", argument) and before.startswith("--") and "=" not in before:
            joined[-1] = f"{before}={argument}"
        else:
            joined.append(argument)
    return joined


def _parser() -> _Parser:
    # Here, because these imports take a second, in which an interrupt is to end like any other.
    from ctcbs_ros.cli import (
        bench,
        branch,
        critical_drag,
        cusp,
        design,
        entry,
        figures,
        orbit_study,
        periodic,
        pose_study,
        replay,
        simulate,
        simulate_cable,
        steady,
        table,
        twin_study,
        validate,
        wind_study,
    )

    parser = _Parser(
        "ctcbs",
        description="Prediction of the end mass of a cable towed by a circling aircraft.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in (
        steady, periodic, branch, cusp, critical_drag, design, figures, table, replay, simulate,
        simulate_cable, entry, bench, orbit_study, wind_study, pose_study,
        twin_study, validate,
    ):  # fmt: skip
        command.add_parser(commands)
    parser.commands = commands.choices
    return parser


def _interrupt(_number: int, _frame) -> None:
    signals.absorb()  # the end removes what is half written
    raise Interrupted


def _terminate(number: int, _frame) -> None:
    signals.absorb()
    raise Terminated(128 + number)
