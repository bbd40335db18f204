"""A day of measuring on the scaled clock: does memory stay flat, and is the list of sessions fast?

    python -m bench soak [--hours 24] [--readings 10000] [--scale 3000] [--page]

One process measures the same poses again and again on a mock hexapod until its clock has gone so
far and there are so many readings, keeps every session in one folder, and looks at its own memory
after each. Then the folder is filled up to 200 sessions by copies, and listed.
"""

import argparse
import asyncio
import os
import resource
import shutil
import sys
import tempfile
import time
from pathlib import Path

from app.demo.station import mock_station
from app.files.site import Site, load_site
from app.session.facts import sessions_under
from app.session.journal import Journal
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from bench._reliability_page import Row, write_row
from bench.wire_faults import POSES

SESSIONS, LISTED_S, GROWTH = 200, 0.3, 1.1
WARM = 3
"""Sessions after which memory is compared: what is imported late is there by then."""


async def one(site: Site, root: Path) -> tuple[Path, int]:
    """Measure once; the folder, and how many readings."""
    plan = measure_plan(site, POSES, PlanOptions(order="pose-by-pose", cycles=4, warm_up=False))
    session = Session.create(site, plan, root, unattended=True)
    await session.connect()
    try:
        return session.folder, (await session.run()).readings
    finally:
        await session.close()


def _resident_mb() -> float:
    """Memory that this process has now; where it cannot be asked, the most that it has had."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _machine_hours(folder: Path) -> float:
    journal = Journal(folder / "journal.sqlite", read_only=True)
    try:
        return journal.last_time() / 3600.0
    finally:
        journal.close()


def listed(root: Path) -> tuple[int, float]:
    """Fill up with copies, and list: how many, and the best processor time of three."""
    there = sorted(path for path in root.iterdir() if path.is_dir())
    for number in range(SESSIONS - len(there)):
        shutil.copytree(there[0], root / f"20000101-{number:06d}-hexapod-measure")
    times = []
    for _ in range(3):
        begun = time.process_time()
        count = len(sessions_under(root))
        times.append(time.process_time() - begun)
    return count, min(times)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--readings", type=int, default=10_000)
    parser.add_argument("--scale", type=float, default=3000.0)
    parser.add_argument("--seconds", type=float, default=320.0)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    begun, hours, readings, memory = time.monotonic(), 0.0, 0, []
    size_kb = 0.0
    with tempfile.TemporaryDirectory() as name:
        root = Path(name) / "sessions"
        os.environ["PKMCAL_STATE"] = str(Path(name) / "state")
        with mock_station("hexapod", 1, options.scale, Path(name)) as file:
            site = load_site(file)
            until = begun + options.seconds
            while (
                hours < options.hours or readings < options.readings
            ) and time.monotonic() < until:
                folder, count = asyncio.run(one(site, root))
                hours, readings = hours + _machine_hours(folder), readings + count
                memory.append(_resident_mb())
                size_kb = (folder / "journal.sqlite").stat().st_size / 1024 / max(count, 1)
        count, seconds = listed(root)
    settled = memory[WARM:] or memory
    growth = max(settled) / settled[0]
    says = (
        f"memory {settled[0]:.0f} to {settled[-1]:.0f} MB (at most {max(settled):.0f}), "
        f"journal {size_kb:.1f} kB a reading; "
        f"{count} sessions listed in {seconds:.2f} s of processor time"
    )
    ran = f"{hours:.1f} machine hours, {readings} readings in {len(memory)} sessions"
    print(f"{ran}: {says}")
    command = f"soak --hours {options.hours:g} --readings {options.readings}"
    if options.page:
        write_row("soak", Row(command, ran, says))
    return 1 if growth > GROWTH or seconds > LISTED_S else 0


if __name__ == "__main__":
    sys.exit(main())
