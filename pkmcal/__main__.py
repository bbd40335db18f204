"""The program's one way in: ``pkmcal``, ``python -m pkmcal``, and every process that it starts.

What lies in the current folder is never imported: Python puts that folder (or this file's) first
among the places where it looks, unless told not to, and here it is taken away again.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]
    _root = str(Path(__file__).resolve().parent.parent)
    if _root not in sys.path:
        sys.path.append(_root)

from pkmcal.names import NameTaken, claim

EXIT_BAD_INPUT = 2


def main() -> None:
    """Run the command line, if the names of our packages are ours."""
    try:
        claim()
    except NameTaken as taken:
        print(f"pkmcal: bad input: {taken}", file=sys.stderr)
        sys.exit(EXIT_BAD_INPUT)
    from app.cli import main as command_line

    command_line()


if __name__ == "__main__":
    main()
