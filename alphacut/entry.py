"""The one entry point: commands, exit statuses, and errors as single lines."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from types import ModuleType

from alphacut.commands import cell as command_cell
from alphacut.commands import check as command_check
from alphacut.commands import envelope as command_envelope
from alphacut.commands import image as command_image
from alphacut.commands import measure_next as command_measure_next
from alphacut.commands import mesh as command_mesh
from alphacut.commands import microstructure as command_microstructure
from alphacut.commands import modulus as command_modulus
from alphacut.commands import repair as command_repair
from alphacut.commands import report as command_report
from alphacut.commands import run as command_run
from alphacut.commands import spectrum as command_spectrum
from alphacut.commands import tolerances as command_tolerances
from alphacut.commands import update as command_update
from alphacut.commands.parser import Parser, refuse_petsc, split_petsc
from alphacut.fuzzy import CampaignError
from alphacut.io.files import rank, ranks, say, standard_output
from alphacut.io.output_paths import check_destinations
from alphacut.io.problem import BadInput, missing
from alphacut.io.provenance import own_version
from alphacut.rve.solver.options import OptionError

COMMANDS: dict[str, ModuleType] = {
    "run": command_run,
    "check": command_check,
    "microstructure": command_microstructure,
    "cell": command_cell,
    "image": command_image,
    "mesh": command_mesh,
    "modulus": command_modulus,
    "envelope": command_envelope,
    "tolerances": command_tolerances,
    "update": command_update,
    "measure-next": command_measure_next,
    "spectrum": command_spectrum,
    "report": command_report,
    "repair": command_repair,
}
STATUSES = """\
exit status:
  0    done
  1    a computation failed: one line says which and what to do
  2    bad input: one line for each problem; nothing was computed or written
  3    a campaign ended with failed samples: the others are kept
  130  interrupted; what was finished is kept, and the same command goes on from there
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
    commands = (
        COMMANDS if names is None else {here: COMMANDS[there] for here, there in names.items()}
    )
    try:
        ours, petsc = split_petsc(sys.argv[1:] if arguments is None else arguments)
        top, made = parsers(program, commands)
        options, left = top.parse_known_args(ours)
        if left:
            made[options.command].refuse([word for word in left if word.startswith("-")] or left)
        refuse_petsc(commands[options.command].__name__.rpartition(".")[2], petsc)
        check_destinations(made[options.command], options)
        with standard_output(getattr(options, "json", None) == "-") as out:
            return int(commands[options.command].run(options, petsc, out))
    except BadInput as error:
        for problem in error.problems:
            say(str(problem))
        return 2
    except OptionError as error:
        say(str(error))
        return 2
    except KeyboardInterrupt:
        say("interrupted; what was finished is kept, and the same command goes on from there")
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 0
    except CampaignError as error:
        say(str(error))
        return 3
    except (RuntimeError, ValueError, ArithmeticError, OSError, MemoryError, ImportError) as error:
        return failed(error)


def failed(error: Exception) -> int:
    """One line about a failed computation; other ranks under mpirun are stopped."""
    if os.environ.get("ALPHACUT_TRACEBACK"):
        raise error
    told = missing(error) if isinstance(error, ModuleNotFoundError) else str(error)
    message = " ".join(told.split()) or type(error).__name__
    if ranks() > 1 and "mpi4py.MPI" in sys.modules:
        print(f"alphacut: rank {rank()}: {message}", file=sys.stderr, flush=True)
        sys.modules["mpi4py.MPI"].COMM_WORLD.Abort(1)
    say(message)
    return 1
