"""A fleet as a hall has it: by one process, by two, by Dask, and who computes dies meanwhile.

    python -m bench fleet [--machines 200] [--out FOLDER] [--page docs/fleet.md]

Hexapods are simulated, 99 readings each, one of them with play in a leg. The fleet is fitted by one
process; by two, of which one is killed after a fifth of the answers; by two Dask workers, of which
one is killed; and by ``pkmcal fleet fit --out``, which is killed as a whole and called again. Every
answer has to be the first one's to the last bit. With ``--out`` what was simulated and fitted is
kept, and what is asked again goes on from there.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pkmcal
from bench._page_table import load, put, table, today

POSES = 33
ODD = "leg4"
PLAY_MM = 0.03
HEAD = ("by", "answers", "processor time", "the same")


@dataclass(frozen=True)
class Fitted:
    """A fleet as somebody fitted it: its answer, and seconds of the processor."""

    by: str
    said: dict[str, Any]
    cpu_s: float
    remark: str = ""

    def cells(self, first: "Fitted") -> tuple[str, ...]:
        """As a row of the table."""
        count = sum(not one["failed"] for one in self.said["machines"])
        same = "" if self is first else ("to the last bit" if self.said == first.said else "NO")
        return (self.by, f"{count}{self.remark}", f"{self.cpu_s:.1f} s", same)


def simulated(folder: Path, count: int) -> Path:
    """The runs of a fleet; those that are there are left as they are."""
    for number in range(count):
        run = folder / f"A{number:03d}"
        if not (run / "points.csv").exists():
            odd = {f"backlash.{ODD}": PLAY_MM} if number == count // 3 else None
            pkmcal.simulate("hexapod", run, seed=1000 + number, poses=POSES, effects=odd)
    return folder


def cpu_s() -> float:
    """Seconds of the processor of this process and of its children that have ended."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in both)


def fitted(by: str, ask: Callable[[], dict[str, Any]], remark: str = "") -> Fitted:
    """Ask, and take the time."""
    began = cpu_s()
    said = ask()
    return Fitted(by, said, cpu_s() - began, remark)


def killing(after: int, victim: Callable[[], int]) -> Callable[[int, int], None]:
    """What kills a process once, when so many are done."""
    killed: list[int] = []

    def watch(done: int, of: int) -> None:
        if done == after and not killed:
            killed.append(victim())
            os.kill(killed[0], signal.SIGKILL)

    return watch


def by_processes(folder: Path, after: int) -> dict[str, Any]:
    """Two processes, of which one is killed."""
    watch = killing(after, lambda: int(active_children()[0].pid or 0))
    return pkmcal.fit_fleet(folder, workers=2, watch=watch).to_json()


def by_dask(folder: Path, after: int) -> dict[str, Any]:
    """Two workers of a scheduler on this computer, of which one is killed."""
    from dask import distributed

    dask: Any = distributed
    with dask.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        watch = killing(after, lambda: int(next(iter(cluster.workers.values())).pid))
        address = cluster.scheduler_address
        return pkmcal.fit_fleet(folder, scheduler=address, watch=watch).to_json()


def gone_on(folder: Path, kept: Path, after: int) -> tuple[dict[str, Any], int]:
    """The verb, killed as a whole and called again; and how many the first call had kept."""
    words = [sys.executable, "-m", "pkmcal", "fleet", "fit", str(folder), "--out", str(kept)]
    with subprocess.Popen(
        [*words, "--workers", "1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        while process.poll() is None and len(list(kept.glob("machines/*.json"))) < after:
            time.sleep(0.05)
        process.kill()
    files = sorted(kept.glob("machines/*.json"))
    text = files[-1].read_text(encoding="utf-8")
    files[-1].write_text(text[: len(text) // 2], encoding="utf-8")  # as a full disk leaves it
    done = subprocess.run(
        [*words, "--workers", "1", "--json"], check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout), len(files) - 1


def rows(folder: Path, count: int) -> Iterator[Fitted]:
    """All of them, as they come."""
    fleet, after = simulated(folder / "fleet", count), count // 5
    yield fitted("one process", lambda: pkmcal.fit_fleet(fleet, workers=1).to_json())
    yield fitted(
        f"two processes, one killed after {after} answers", lambda: by_processes(fleet, after)
    )
    yield fitted(
        f"Dask, two workers, one killed after {after} answers", lambda: by_dask(fleet, after)
    )
    kept, had = folder / "kept", 0

    def ask() -> dict[str, Any]:
        nonlocal had
        said, had = gone_on(fleet, kept, after)
        return said

    found = fitted("`fleet fit --out`, killed, a file cut in half, called again", ask)
    yield Fitted(found.by, found.said, found.cpu_s, f", {had} kept from the first call")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    print(" | ".join(HEAD))
    cells, named = [], set()
    with tempfile.TemporaryDirectory() as scratch:
        first: Fitted | None = None
        for row in rows(options.out or Path(scratch), options.machines):
            first = first or row
            cells.append(row.cells(first))
            named |= {(one["machine"], one["what"]) for one in row.said["outliers"]}
            print(" | ".join(cells[-1]), flush=True)
    who = ", ".join(f"{machine} ({what})" for machine, what in sorted(named)) or "nobody"
    print(f"not like the others: {who}; play was hidden in A{options.machines // 3:03d}")
    if options.page is not None:
        said = f"`python -m bench fleet --machines {options.machines}`, {today()}; {load()}:"
        end = f"Not like the others: {who}. Play was hidden in A{options.machines // 3:03d}."
        put(options.page, "fleet", f"{said}\n\n{table(HEAD, cells)}\n\n{end}")


if __name__ == "__main__":
    main()
