"""The table of speed: every kind of work by numpy, by the compiled core, and by a peer, in one run.

    python -m bench speed [--page docs/speed.md] [--without-verbs]

Old is the same program without the core (``PKMCAL_COMPILED=off``) and, of the Monte Carlo, one fit
after the other. Times are CPU times, the least of some; only ratios of one run compare. With
``--page`` the table is written into the page; ``bench stream`` does so with what a streamed pose
takes.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bench._page_table import load, put, table, today
from bench._speed_rows import Row, identifications, kinematics, verbs
from calib.mechanism import kernel

HEAD = ("work", "old", "new", "old / new", "peer", "new / peer", "peer is")


def rows(with_verbs: bool) -> Iterator[Row]:
    """All rows, as they come."""
    yield from kinematics()
    yield from identifications()
    if with_verbs:
        with tempfile.TemporaryDirectory() as folder:
            yield from verbs(Path(folder))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--without-verbs", action="store_true")
    options = parser.parse_args()
    if not kernel.available():
        raise SystemExit("the compiled core was not built here: install again where a compiler is")
    print(" | ".join(HEAD))
    found = []
    for row in rows(not options.without_verbs):
        found.append(row)
        print(" | ".join(row.cells()), flush=True)
    if options.page is not None:
        said = f"`python -m bench speed`, {today()}, core for {kernel.processor()}; {load()}:"
        put(options.page, "speed", f"{said}\n\n{table(HEAD, (row.cells() for row in found))}")


if __name__ == "__main__":
    main()
