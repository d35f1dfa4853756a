"""``alphacut …`` and ``python -m alphacut …``."""

import gc
import os
import signal
import sys
import threading
from collections.abc import Mapping


def main(program: str = "alphacut", names: Mapping[str, str] | None = None) -> int:
    """Run the command line of this process, which is the program's own; return its exit status.

    A `check` that finds no problem ends the process itself, at once.

    Args:
        program: The program's name, for messages.
        names: Commands by the names that the user writes, as named in `COMMANDS`; all of them if
            left out.
    """
    # Imports make objects that stay. To look through them for garbage takes .05 s with Python's own
    # threshold of 2,000 objects or fewer, and .04 s with 20,000.
    gc.set_threshold(100_000)
    # Pydantic, which commands on cases import, looks for plugins in every installed distribution,
    # and checks each schema that it makes itself: that takes .1 s, and no command needs either.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    os.environ.setdefault("PYDANTIC_SKIP_VALIDATING_CORE_SCHEMAS", "1")
    from alphacut.commands.table import COMMANDS
    from alphacut.entry import main as run

    commands = COMMANDS
    if names is not None:
        commands = {name: COMMANDS[known] for name, known in names.items()}
    status = run(program=program, commands=commands)
    # Python frees every object and module at its end, which takes .06 s. A `check` that found no
    # problem has flushed and closed what it wrote. Work is left only to MPI and other threads.
    is_check = sys.argv[1:2] == ["check"] and status == 0
    has_work_left = "mpi4py" in sys.modules or threading.active_count() > 1
    if not has_work_left:
        if is_check:
            os._exit(status)
        # A signal while Python frees them would take the place of the status.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
    return status


if __name__ == "__main__":
    sys.exit(main())
