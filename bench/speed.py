"""The table of speed: every kind of work by numpy, by the compiled core, and by a peer, in one run.

    python -m bench speed [--page docs/speed.md] [--without-verbs]

Old is the same program without the core (``PKMCAL_COMPILED=off``) and, of the Monte Carlo, one fit
after the other. Times are CPU times, the least of some; only ratios of one run compare. With
``--page`` the table and the latencies of a stream (``bench stream``) are written into the page.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import re
import tempfile
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from bench._speed_rows import Row, identifications, kinematics, load, verbs
from bench.stream import Latency, measured
from calib.mechanism import kernel

HEAD = ("work", "old", "new", "old / new", "peer", "new / peer", "peer is")
LATENCIES = ("a pose of a stream, ms", "p50", "p99", "longest")


def rows(with_verbs: bool) -> Iterator[Row]:
    """All rows, as they come."""
    yield from kinematics()
    yield from identifications()
    if with_verbs:
        with tempfile.TemporaryDirectory() as folder:
            yield from verbs(Path(folder))


def table(head: Iterable[str], lines: Iterable[Iterable[str]]) -> str:
    """A table of a page."""
    head = list(head)
    parts = [head, ["---"] * len(head), *map(list, lines)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in parts)


def write(page: Path, found: list[Row], latencies: list[Latency]) -> None:
    """Put both tables between the marks of the page."""
    said = f"`python -m bench speed`, {datetime.now(UTC):%d %B %Y}, core for {kernel.processor()}"
    streams = [
        (one.what, f"{one.p50:.3f}", f"{one.p99:.3f}", f"{one.longest:.3f}") for one in latencies
    ]
    text = (
        f"{said}; {load()}:\n\n{table(HEAD, (row.cells() for row in found))}\n\n"
        f"{table(LATENCIES, streams)}\n"
    )
    whole = page.read_text(encoding="utf-8")
    pattern = re.compile(r"(<!-- speed -->\n)(.*?)(<!-- end -->)", re.DOTALL)
    if pattern.search(whole) is None:
        raise SystemExit(f"{page} has no marks <!-- speed --> and <!-- end -->")
    made = pattern.sub(lambda marks: f"{marks[1]}\n{text}\n{marks[3]}", whole)
    page.write_text(made, encoding="utf-8")


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
        write(options.page, found, measured(1000))


if __name__ == "__main__":
    main()
