"""Start a station's LinuxCNC again, and wait until it runs: ``python -m ... FOLDER``."""

import sys
import time
from pathlib import Path

from mocks.linuxcnc.program import END_S, START_S
from mocks.linuxcnc.server import RESTART


def main(folder: Path) -> int:
    """Exit code 0 when it runs again, 3 if it does not."""
    wanted = folder / RESTART
    wanted.touch()
    deadline = time.monotonic() + START_S + END_S
    while wanted.exists():
        if time.monotonic() > deadline:
            print("error: LinuxCNC does not start again", file=sys.stderr)
            return 3
        time.sleep(0.05)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
