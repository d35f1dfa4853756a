"""The one entry point: commands, exit statuses, and errors as single lines."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType

from alphacut.commands.parser import Parser, split_petsc
from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import leave as leave
from alphacut.io.files import open_streams, rank, ranks, say, standard_output
from alphacut.io.netcdf import finished
from alphacut.io.output_paths import check_destinations
from alphacut.io.problem import BadInput, Problem, missing
from alphacut.io.provenance import door, own_version
from alphacut.rve.interruption import stoppable

NAMES = "run", "check", "microstructure", "cell", "modulus", "envelope", "identify", "report"


class Commands(Mapping[str, ModuleType]):
    """Modules of `alphacut.commands`, each imported when it is looked up.

    Args:
        names: Names of the commands, as a user writes them, to their names in `NAMES`.
    """

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = dict(names)

    def __getitem__(self, name: str) -> ModuleType:
        return import_module(f"alphacut.commands.{self._names[name]}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def meant(self, arguments: Sequence[str]) -> Commands:
        """The one that a command line begins with; all where it begins with none."""
        own = {name: self._names[name] for name in arguments[:1] if name in self._names}
        return Commands(own) if own else self


COMMANDS = Commands({name: name for name in NAMES})
STATUSES = """\
exit status:
  0    done
  1    a computation failed: one line says which and what to do
  2    bad input: one line for each problem; nothing was computed or written
  3    a campaign ended with failed samples: the others are kept
  130  interrupted, 143 by SIGTERM, 129 by SIGHUP; one line says what is kept
"""


def parsers(program: str, commands: Mapping[str, ModuleType]) -> tuple[Parser, dict[str, Parser]]:
    """Parser of a program with the given commands, and the commands' parsers by name."""
    top = Parser(
        prog=program,
        description="From an uncertain microstructure to the fuzzy vibration of a structure.",
        epilog=STATUSES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"alphacut {own_version()}")
    inner = top.add_subparsers(
        dest="command", metavar="COMMAND", required=True, parser_class=Parser
    )
    made: dict[str, Parser] = {}
    for name, module in commands.items():
        about = module.ABOUT
        made[name] = inner.add_parser(
            name, help=about, description=f"{about[:1].upper()}{about[1:]}.", allow_abbrev=False
        )
        module.arguments(made[name])
        made[name].usage = usage(f"{program} {name}", made[name])
    return top, made


def usage(command: str, parser: Parser) -> str:
    """One line: what a command cannot do without."""
    needed = [
        " ".join(filter(None, [*action.option_strings[:1], str(action.metavar)]))
        for action in parser._actions
        if action.required
    ]
    return " ".join([command, *needed, "[OPTIONS]"])


def main(
    arguments: Sequence[str] | None = None,
    *,
    program: str = "alphacut",
    names: Mapping[str, str] | None = None,
) -> int:
    """Run one command.

    Args:
        arguments: The command line after the program's name; the process's own if left out.
        program: The program's name, for messages.
        names: Names of the commands here to their names in `COMMANDS`; all of them under their own
            names if left out.

    Returns:
        Exit status, see `STATUSES`.
    """
    options = argparse.Namespace(command="")
    open_streams()
    with stoppable() as came:
        try:
            ours, petsc = split_petsc(sys.argv[1:] if arguments is None else arguments)
            commands = (COMMANDS if names is None else Commands(names)).meant(ours)
            top, made = parsers(program, commands)
            options, left = top.parse_known_args(ours)
            if left:
                made[options.command].refuse([one for one in left if one.startswith("-")] or left)
            check_destinations(made[options.command], options)
            with standard_output(getattr(options, "json", None) == "-") as out, plain_warnings():
                return int(commands[options.command].run(options, petsc, out))
        except (BadInput, RefusedError) as error:
            for problem in getattr(error, "problems", None) or [Problem.of(error)]:
                say(str(problem))
            return 2
        except KeyboardInterrupt:
            how = f"ended by {signal.Signals(came[0]).name}" if came else "interrupted"
            say(f"{how}; {interrupted(options)}")
            if came and ranks() > 1 and "mpi4py.MPI" in sys.modules:  # others may wait for this one
                sys.modules["mpi4py.MPI"].COMM_WORLD.Abort(128 + came[0])
            return 128 + (came or [signal.SIGINT])[0]
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            return 0
        except CampaignError as error:
            say(pasted(str(error)))
            return 3
        except (RuntimeError, ValueError, ArithmeticError, OSError, MemoryError, ImportError) as e:
            return failed(e)


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Warnings of the libraries as lines of this program, each once, without places in sources."""
    told: set[str] = set()

    def show(message: Warning | str, *_: object, **__: object) -> None:
        if (text := " ".join(str(message).split())) not in told:
            told.add(text)
            say(f"warning: {pasted(text)}")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def interrupted(options: argparse.Namespace) -> str:
    """What is left of the work of a command that was interrupted."""
    keeping = {"envelope": ("out",), "modulus": ("store",)}
    names = keeping.get(options.command, ())
    if options.command != "run" and not any(getattr(options, name, None) for name in names):
        how = " or ".join(f"--{name}" for name in names)
        return f"without {how} nothing is kept" if how else "nothing is kept"
    if not (kept := unfinished(options)):
        return "nothing was finished yet, so nothing is kept"
    return f"what was finished is kept in {kept}, and the same command goes on from there"


def unfinished(options: argparse.Namespace) -> Path | None:
    """The file or folder from which the same command goes on; None if nothing is kept there."""
    if options.command == "run":
        from alphacut.commands.run import folder_of

        folder = folder_of(options)
        return folder if finished(folder) else None
    store = options.store if options.command == "modulus" else None
    path = Path(store or f"results/{Path(options.case).stem}/samples.db")
    if options.command == "envelope":
        path = Path(options.out).with_suffix(".partial.npz")
    return path if path.is_file() and path.stat().st_size else None


def failed(error: Exception) -> int:
    """One line about a failed computation; other ranks under mpirun are stopped."""
    if os.environ.get("ALPHACUT_TRACEBACK"):
        raise error
    told = missing(error) if isinstance(error, ModuleNotFoundError) else str(error)
    message = " ".join(told.split()) or type(error).__name__
    if ranks() > 1 and "mpi4py.MPI" in sys.modules:
        print(f"alphacut: rank {rank()}: {message}", file=sys.stderr, flush=True)
        sys.modules["mpi4py.MPI"].COMM_WORLD.Abort(1)
    say(pasted(message))
    return 1


def pasted(message: str) -> str:
    """A message of the libraries, whose commands are those of this door."""
    return message.replace("python -m alphacut", door())
