"""How the program starts itself again, as a process of its own."""

import sys
from pathlib import Path

WAY_IN = Path(__file__).resolve().parent.parent / "pkmcal" / "__main__.py"
"""Run as a file, it finds our packages beside itself, however the program was installed."""


def command_of(*arguments: str) -> list[str]:
    """The command line of ``pkmcal ARGUMENTS`` in this Python.

    ``-P``: the child looks for modules neither in the current folder nor in that of a script. What
    PYTHONPATH and the user's own packages add is kept, since an installation may rest on them.
    """
    return [sys.executable, "-P", str(WAY_IN), *arguments]
