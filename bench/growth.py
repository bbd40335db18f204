"""Time and memory of fit, compare, diagnose and discover as the number of readings grows.

    python -m bench growth [--readings 300 1000 3000 10000 30000] [--verbs fit diagnose]
                           [--limit 600] [--out FOLDER]

Every verb is asked as from the command line, in a process of its own: CPU seconds of user and
system, and the largest resident memory, as the kernel has counted them. Runs are of a hexapod with
play in one leg, three SMRs read at each pose. A power law is fitted from the smallest number of
readings to the largest: how much ten times the readings cost is ten to its exponent. What does not
end within ``--limit`` seconds of CPU is left out, and larger runs of that verb with it. With
``--out`` the table is written as ``growth.json``, line by line as it comes, and drawn as
``growth.png``; asked again with the same folder, only what is not in the table is measured.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

VERBS = ("fit", "compare", "diagnose", "discover")
READINGS = (300, 1000, 3000, 10000, 30000)


@dataclass(frozen=True)
class Cost:
    """What one verb has taken for so many readings."""

    verb: str
    readings: int
    cpu_s: float
    memory_mb: float


def simulated(folder: Path, readings: int) -> Path:
    """A run of so many readings, three at each pose and the reference nests'."""
    run = folder / f"run-{readings}"
    poses = max(20, round(readings * 0.306))
    command = ["simulate", "hexapod", "--poses", str(poses), "--order", "pose-by-pose"]
    done = _asked([*command, "--effect", "backlash.leg3=0.015", "--out", str(run)], 3600)
    if done is None:
        sys.exit(f"a run of {readings} readings could not be simulated")
    return run


def _asked(arguments: list[str], limit: int) -> tuple[float, float] | None:
    """CPU seconds and MB of ``pkmcal`` with arguments; None where it ends in another way."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))

    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    child = subprocess.Popen(
        [sys.executable, "-m", "pkmcal", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=environment,
        preexec_fn=limited,
    )
    assert child.stderr is not None
    said = child.stderr.read().decode(errors="replace")
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        print(f"pkmcal {' '.join(arguments)}: {child.returncode} {said[-400:]}", file=sys.stderr)
        return None
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0


def count_of(run: Path) -> int:
    """Readings in a run."""
    lines = (run / "points.csv").read_text(encoding="utf-8").splitlines()
    return sum(not line.startswith("#") for line in lines if line) - 1


class Table:
    """Costs in the order of verbs and readings, kept in a folder where there is one."""

    def __init__(self, folder: Path | None) -> None:
        self._file = None if folder is None else folder / "growth.json"
        self.costs: list[Cost] = []
        if self._file is not None and self._file.exists():
            self.costs = [Cost(**one) for one in json.loads(self._file.read_text("utf-8"))]

    def __contains__(self, asked: tuple[str, int]) -> bool:
        return asked in {(cost.verb, cost.readings) for cost in self.costs}

    def add(self, cost: Cost) -> None:
        """Keep one more, and print it."""
        print(
            f"{cost.verb:9} {cost.readings:7} readings"
            f" {cost.cpu_s:8.2f} s {cost.memory_mb:7.0f} MB",
            flush=True,
        )
        self.costs.append(cost)
        self.costs.sort(key=lambda one: (VERBS.index(one.verb), one.readings))
        if self._file is not None:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps([asdict(one) for one in self.costs], indent=1)
            self._file.write_text(text + "\n", encoding="utf-8")


def measure(table: Table, verbs: list[str], readings: list[int], limit: int) -> None:
    """Costs of all verbs for all sizes that the table has not, printed as they come."""
    with tempfile.TemporaryDirectory() as folder:
        left = list(verbs)
        for wanted in sorted(readings):
            run = simulated(Path(folder), wanted)
            count = count_of(run)
            for verb in [one for one in left if (one, count) not in table]:
                cost = _asked([verb, str(run)], limit)
                if cost is None:
                    left.remove(verb)
                    continue
                table.add(Cost(verb, count, *cost))


def exponent(costs: list[Cost], what: str) -> float:
    """Exponent of the power law between the smallest and the largest run; nan of one run."""
    if len(costs) < 2:
        return float("nan")
    first, last = costs[0], costs[-1]
    ratio = getattr(last, what) / getattr(first, what)
    return float(np.log(ratio) / np.log(last.readings / first.readings))


def drawn(costs: list[Cost], file: Path) -> None:
    """Both costs over the readings, on logarithmic axes, with a line of growth in proportion."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    for verb in dict.fromkeys(cost.verb for cost in costs):
        own = [cost for cost in costs if cost.verb == verb]
        count = [cost.readings for cost in own]
        axes[0].loglog(count, [cost.cpu_s for cost in own], "o-", label=verb)
        axes[1].loglog(count, [cost.memory_mb for cost in own], "o-", label=verb)
    sizes = np.array(sorted({cost.readings for cost in costs}), dtype=float)
    for axis, what in zip(axes, ("cpu_s", "memory_mb"), strict=True):
        most = max(getattr(cost, what) for cost in costs if cost.readings == sizes[-1])
        axis.loglog(sizes, most * sizes / sizes[-1], "k:", label="in proportion")
        axis.set_xlabel("readings")
    axes[0].set_ylabel("CPU, s")
    axes[1].set_ylabel("memory, MB")
    axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=110, metadata={"Software": None})


def main() -> None:
    """Measure, print exponents, and write what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--readings", type=int, nargs="+", default=list(READINGS))
    parser.add_argument("--verbs", nargs="+", default=list(VERBS), choices=VERBS)
    parser.add_argument("--limit", type=int, default=600, help="CPU seconds of one verb")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    table = Table(options.out)
    measure(table, options.verbs, options.readings, options.limit)
    costs = table.costs
    for verb in options.verbs:
        own = [cost for cost in costs if cost.verb == verb]
        if own:
            time, memory = exponent(own, "cpu_s"), exponent(own, "memory_mb")
            print(
                f"{verb:9} from {own[0].readings} to {own[-1].readings} readings:"
                f" time ~ n^{time:.2f}, memory ~ n^{memory:.2f}"
            )
    if options.out is not None:
        drawn(costs, options.out / "growth.png")


if __name__ == "__main__":
    main()
