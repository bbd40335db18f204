"""One command to a running station: ``pkmcal mock do SITE payload kg=10``.

SITE is the site file that the station wrote, or the address of its control socket; the commands
are those of ``mocks.control``. The answer is one line of JSON on standard output; exit code 2 if
the station says no or is not there.
"""

import json
import sys
from pathlib import Path
from typing import Any

from mocks.control import ControlClient
from mocks.physics.table_file import read_table


def address_of(where: str) -> str:
    """Address of the control socket: as given, or the one that a site file names."""
    path = Path(where)
    if not path.is_file():
        return where
    hands = read_table(path).get("hands", {})
    if not isinstance(hands, dict) or "control" not in hands:
        raise ValueError(f"{path}: this site has no mock's control socket ([hands] control)")
    return str(hands["control"])


def value_of(text: str) -> Any:
    """A value of the command line: JSON where it is JSON (10, true, [1, 2]), else the text."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def main(argv: list[str]) -> int:
    """Send one command and print the answer; the exit code."""
    if len(argv) < 2 or not all("=" in word for word in argv[2:]):
        print("usage: pkmcal mock do SITE COMMAND [NAME=VALUE]...", file=sys.stderr)
        return 2
    given = dict(word.split("=", 1) for word in argv[2:])
    try:
        with ControlClient(address_of(argv[0])) as client:
            answer = client(argv[1], **{name: value_of(text) for name, text in given.items()})
    except (OSError, ValueError) as error:
        print(f"{argv[0]}: {error}", file=sys.stderr)
        return 2
    print(json.dumps(answer))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
