"""``alphacut …`` and ``python -m alphacut …``."""

import gc
import os
import sys
from collections.abc import Mapping


def main(program: str = "alphacut", names: Mapping[str, str] | None = None) -> int:
    """Run the command line of this process, which is the program's own; return its exit status.

    Args:
        program: The program's name, for messages.
        names: Commands by the names that the user writes, as named in `COMMANDS`; all of them if
            left out.
    """
    # Imports make objects that stay. To look through them for garbage takes .05 s with Python's own
    # threshold of 2,000 objects or fewer.
    gc.set_threshold(20_000)
    # Pydantic, which commands on cases import, looks for plugins in every installed distribution,
    # and checks each schema that it makes itself: that takes .1 s, and no command needs either.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    os.environ.setdefault("PYDANTIC_SKIP_VALIDATING_CORE_SCHEMAS", "1")
    from alphacut.commands.table import COMMANDS
    from alphacut.entry import main as run

    commands = COMMANDS
    if names is not None:
        commands = {name: COMMANDS[known] for name, known in names.items()}
    return run(program=program, commands=commands)


if __name__ == "__main__":
    sys.exit(main())
