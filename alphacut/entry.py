"""The one entry point: commands, signals, exit statuses, and errors as single lines."""

from __future__ import annotations

import argparse
import logging
import math
import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import FrameType

from alphacut.base.errors import FailedError, RefusedError
from alphacut.commands.options import Command, Parser, require_petsc, split_petsc
from alphacut.commands.table import COMMANDS
from alphacut.fuzzy.campaign.call import CampaignError
from alphacut.io.files import (
    BadInput,
    check_destinations,
    missing,
    rank,
    ranks,
    say,
    standard_output,
)
from alphacut.io.provenance import own_version
from alphacut.rve.interruption import STOP_SIGNALS

LOG = logging.getLogger(__name__)
DEBUG = "--debug"
"""The option of every command that shows what is logged."""
STATUSES = """\
exit status:
  0    done
  1    a computation failed: one line says which and what to do
  2    bad input: one line for each problem; nothing was computed or written
  3    a campaign ended with failed samples: the others are kept
  130  interrupted, 143 by SIGTERM, 129 by SIGHUP
"""


class ShowVersion(argparse.Action):
    """Option that prints the version, which takes time to find, and ends the process."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        """Print the version, and raise SystemExit."""
        print(f"alphacut {own_version()}")
        parser.exit()


def build_parsers(
    program: str, commands: Mapping[str, Command], words: Sequence[str]
) -> tuple[Parser, dict[str, Parser]]:
    """Return the parser of a program, and the parser of each of its commands by name.

    Args:
        program: Name of the program, for its texts.
        commands: Its commands by name.
        words: Words of the command line. Commands that are none of them get no options.
    """
    parser = Parser(
        prog=program,
        description="From an uncertain microstructure to the fuzzy vibration of a structure.",
        epilog=STATUSES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=ShowVersion, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(
        dest="command", metavar="COMMAND", required=True, parser_class=Parser
    )
    by_name: dict[str, Parser] = {}
    for name, command in commands.items():
        about = f"{command.about[:1].upper()}{command.about[1:]}."
        # No abbreviations of options: one that is unique today need not be so with the next option.
        of_command = subparsers.add_parser(
            name, help=command.about, description=about, allow_abbrev=False
        )
        if name in words:
            command.arguments(of_command)
        of_command.set_defaults(run=command.run)
        shown = "log what is done; a traceback with every error"
        of_command.add_argument(DEBUG, action="store_true", help=shown)
        by_name[name] = of_command
    return parser, by_name


def main(
    arguments: Sequence[str] | None = None,
    *,
    program: str = "alphacut",
    commands: Mapping[str, Command] = COMMANDS,
) -> int:
    """Run one command of the command line, and return its exit status.

    Every error becomes one line on standard error. The status is 2 for bad input, 3 for failed
    samples of a campaign, 128 plus the signal's number for an interruption, and 1 for any other
    failure; 0 for success, and also if the reader of the output has gone. An error of the program
    itself shows its traceback. The options --help and --version end the process by SystemExit.

    Args:
        arguments: The command line after the program's name; the process's own if left out.
        program: The program's name, for messages.
        commands: Its commands by name.
    """
    words = arguments
    if words is None:
        words = sys.argv[1:]
    with interrupt_on_stop_signals() as signals:
        try:
            with show_log(DEBUG in words):
                return _run_command(words, program, commands)
        except (BadInput, RefusedError) as error:
            for line in str(error).splitlines():  # one for each problem
                say(line)
            return 2
        except KeyboardInterrupt:
            number = int(signal.SIGINT)
            cause = "interrupted"
            if signals:
                number = signals[0]
                cause = f"ended by {signal.Signals(number).name}"
            message = f"{cause}; a run continues from the stages and samples that it has finished"
            return _end_with_message(message, 128 + number)  # as shells report signals
        except BrokenPipeError:
            _discard_output()  # the reader has gone, as with `| head`
            return 0
        except CampaignError as error:
            return _end_with_message(error.what, 3)  # its cure is an argument in Python
        except ModuleNotFoundError as error:
            return _end_with_message(missing(error), 1)
        except (FailedError, OSError, MemoryError, ImportError) as error:
            _discard_output()  # where the disk behind it is full
            return _end_with_message(str(error) or type(error).__name__, 1)
        except Exception as error:
            # No part of this program raises it on purpose: the user is to report it whole.
            traceback.print_exc()
            what = f"{type(error).__name__} is an error of this program"
            return _end_with_message(f"{what}: report the lines above, and the case", 1)


def _discard_output() -> None:
    """Lead standard output to nowhere if it takes nothing: it is flushed again as Python ends."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


@contextmanager
def interrupt_on_stop_signals() -> Iterator[list[int]]:
    """Let SIGTERM and SIGHUP interrupt the block as Ctrl-C does; ignored ones stay so (nohup).

    Signals within a second of each other count as one: batch systems signal a process and then its
    group. Only the main thread may set handlers; in another one nothing is changed.

    Yields:
        The list of the signal numbers received, which grows while the block runs.
    """
    received = list[int]()
    last_time = -math.inf
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    # A handler of None was not set by Python, which could not set it again. An ignored signal is
    # one that a caller such as nohup wants ignored.
    previous = {k: x for k, x in handlers.items() if x not in (None, signal.SIG_IGN)}

    def stop(number: int, frame: FrameType | None) -> None:
        """Note a signal, and call the handler of SIGINT unless one came within the last second.

        The handler of SIGINT raises KeyboardInterrupt, unless somebody has set another one.

        Args:
            number: Number of the signal.
            frame: Frame that it interrupted, for the handler.
        """
        nonlocal last_time
        received.append(number)  # all of them: the first one tells the exit status
        now = time.monotonic()
        if now - last_time >= 1.0:
            last_time = now
            interrupt = signal.getsignal(signal.SIGINT)
            handler = interrupt if callable(interrupt) else signal.default_int_handler
            handler(number, frame)

    for number in previous:
        signal.signal(number, stop)
    try:
        yield received
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def show_log(is_on: bool) -> Iterator[None]:
    """Show the log of the block on standard error if `is_on`, with the traceback of its error.

    After the block the logger "alphacut" has the level NOTSET and no handler of this function.
    Errors of the block leave it.
    """
    logger = logging.getLogger("alphacut")
    handler = logging.StreamHandler()
    if is_on:
        logger.addHandler(handler)
        logger.setLevel(logging.DEBUG)
    try:
        yield
    except Exception:
        LOG.debug("the command ended by this error", exc_info=True)
        raise
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)


def _run_command(arguments: Sequence[str], program: str, commands: Mapping[str, Command]) -> int:
    """Read a command line and run its command; return the exit status.

    Python's warnings become lines "warning: …" on standard error while the command runs.

    Args:
        arguments: The command line after the program's name. Options of the solver library PETSc,
            which begin with -rve_, may stand anywhere; commands on a case get them as
            `options.petsc`, and for other commands they are refused.
        program: The program's name, for messages.
        commands: Its commands by name.

    Raises:
        RefusedError: An option is unknown or does not fit, or a file cannot be written. Errors of
            the command itself leave this function as well.
    """
    words, petsc = split_petsc(arguments)
    parser, by_name = build_parsers(program, commands, words)
    options, unknown = parser.parse_known_args(words)
    if unknown:
        # Values of an unknown option are unknown words as well: the option is named.
        first = next((word for word in unknown if word.startswith("-")), unknown[0])
        by_name[options.command].refuse(first)
    if "case" not in options:  # no prisms are solved
        require_petsc(petsc)
    options.petsc = petsc
    if options.json == "/dev/stdout":  # opened again, it would write over what a file holds
        options.json = "-"
    check_destinations(by_name[options.command], options)
    with standard_output(alone=options.json == "-") as out, warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: say(f"warning: {message}")
        status: int = options.run(options, out)
        return status


def _end_with_message(message: str, status: int) -> int:
    """Print why a command ended, abort the other processes under MPI, and return `status`.

    Processes that wait for this one in a collective operation would otherwise wait forever.

    Args:
        message: One line.
        status: Exit status of the command.
    """
    say(message)
    if ranks() > 1 and "mpi4py.MPI" in sys.modules:
        print(f"alphacut: rank {rank()}: {message}", file=sys.stderr, flush=True)
        sys.modules["mpi4py.MPI"].COMM_WORLD.Abort(status)
    return status
