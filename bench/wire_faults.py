"""Sessions behind a proxy that spoils what passes: typed faults in time, no wrong value taken.

    python -m bench wire_faults [--faults 2000] [--seed 1] [--link tracker | controller]
        [--machine hexapod | tripod] [--with bare | pose | geocom | lines] [--page]

A mock without errors of its own is measured once as it is; then again and again with a proxy
between (bench/_wire_proxy.py) that delays, splits, merges, drops, duplicates, truncates, corrupts,
stalls and resets. Every session must end well or with a typed fault within its deadline, without a
word of a library; every reading in a journal is compared with that of the clean session.
"""

import argparse
import asyncio
import contextlib
import io
import json
import os
import random
import socket
import sys
import tempfile
import time
import tomllib
from collections import Counter
from dataclasses import replace
from pathlib import Path

import tomli_w

from app.demo.station import mock_station
from app.errors import GateRefused, StoppedByOperator
from app.files.pose_table import Pose
from app.files.site import Site, load_site
from app.session.journal import Journal
from app.session.plans import PlanOptions, measure_plan, order_for
from app.session.session import Session
from bench._reliability_page import Row, write_row
from bench._wire_proxy import HARM, Proxy
from drivers.errors import DeviceError

POSES: dict[str, Pose] = {
    "a": (5.0, 0.0, 222.0, 0.05, 0.0, 0.1),
    "b": (-6.0, 4.0, 216.0, 0.0, 0.06, -0.1),
    "c": (0.0, -7.0, 224.0, -0.05, 0.03, 0.05),
}
TRIPOD: dict[str, Pose] = {
    "a": (20.0, 0.0, -125.0, 0.0, 0.0, 0.0),
    "b": (-25.0, 15.0, -150.0, 0.0, 0.0, 0.0),
    "c": (0.0, -30.0, -140.0, 0.0, 0.0, 0.0),
}
PLAN = PlanOptions(warm_up=False, two_face=False)
SCALE, LONGEST_S = 600.0, 60.0
SLOW = {"geocom": 60.0, "lines": 40.0}
"""Machine seconds in one of the wall where an instrument is asked for every reading by itself."""
AWAY_MM = 0.2
"""A reading farther than this from the clean session's is wrong; noise is a few um."""
VAGUE_MM = 2.0
"""The same of a total station, whose readings scatter by some tenths."""


Place = tuple[float, float, float]


def poses_of(site: Site) -> dict[str, Pose]:
    """Poses of its machine."""
    return TRIPOD if site.machine.name == "tripod" else POSES


async def measured(site: Site, root: Path, proxy: Proxy | None, share: float) -> tuple[str, Path]:
    """One session; what it ended with, and its folder."""
    options = replace(PLAN, order=order_for(site))
    plan = measure_plan(site, poses_of(site), options)
    session = Session.create(site, plan, root, unattended=True)
    try:
        async with asyncio.timeout(LONGEST_S):
            await session.connect()
            if proxy is not None:
                proxy.spoil(share)
            await session.run()
        return "ended well", session.folder
    except TimeoutError:
        return f"FOUND: no end within {LONGEST_S:g} s", session.folder
    except DeviceError as fault:
        return type(fault).__name__, session.folder
    except (GateRefused, StoppedByOperator) as refused:
        return type(refused).__name__, session.folder
    except Exception as error:
        return f"FOUND: {type(error).__name__}: {str(error)[:120]}", session.folder
    finally:
        if proxy is not None:
            proxy.spoil(0.0)
        begun = time.monotonic()
        await session.close()
        if time.monotonic() - begun > 10.0:
            print(f"closing took {time.monotonic() - begun:.1f} s")


def truth_in(folder: Path) -> Path:
    """A folder with the parameters of a mock that is as it was drawn."""
    folder.mkdir()
    path = folder / "truth.json"
    path.write_text(json.dumps({"parameters": {}}))
    return path


def read(folder: Path) -> dict[str, Place]:
    """Good readings by step."""
    journal = Journal(folder / "journal.sqlite", read_only=True)
    try:
        rows = [row for row in journal.rows() if row.kind == "reading" and row.xyz is not None]
        return {row.step: row.xyz for row in rows if row.xyz}
    finally:
        journal.close()


WHERE = {"tracker": "tracker_there", "controller": "controller"}
"""Where a site keeps what is on a link."""


def behind(site: Site, link: str, dice: random.Random, harm: float = HARM) -> tuple[Site, Proxy]:
    """The site with a proxy in one of its links."""
    part = site.tracker if link == "tracker" else site.controller
    key, value = next(
        (key, value) for key, value in part.settings.items()
        if isinstance(value, str) and ":" in value and part.address.endswith(value)
    )  # fmt: skip
    far = value.removeprefix("socket://")
    proxy = Proxy(far, dice, harm)
    settings = {**part.settings, key: value.replace(far, proxy.address)}
    changed = replace(part, settings=settings, address=part.address.replace(far, proxy.address))
    return replace(site, **{WHERE[link]: changed}), proxy


def over_tcp(file: Path, port: int) -> Site:
    """The site of a mock, its controller on TCP, its stream of lines as the shipped kind."""
    told = tomllib.loads(file.read_text("utf-8"))
    if "port" in told["controller"]:
        told["controller"]["port"] = f"socket://127.0.0.1:{port}"
    tracker = told["tracker"]
    if tracker["kind"] == "line-stream":
        tracker |= {"kind": "lines", "source": tracker.pop("address"), "unit": "mm"}
        tracker["silence_s"] = 2.0
    file.write_text(tomli_w.dumps(told), encoding="utf-8")
    return load_site(file)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


class Trial:
    """What came of the sessions so far; one line of sessions on one mock: :meth:`sessions`."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.until = time.monotonic() + options.seconds
        self.ends: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.readings = self.wrong = 0
        self.away_mm = VAGUE_MM if options.kind == "geocom" else AWAY_MM

    async def sessions(self, folder: Path, number: int) -> None:
        """Measure once as it is, then spoilt, until there were enough faults."""
        options = self.options
        dice = random.Random(f"{options.seed} {options.link} {options.machine} {number}")
        port = free_port()
        words = ["--truth", str(truth_in(folder)), "--controller-port", str(port)]
        words += [f"--{options.kind}"] if options.kind else []
        words += ["--smrs", "1", "--no-base-smrs"] if options.kind == "lines" else []  # it sees one
        scale = SLOW.get(options.kind, SCALE)
        with mock_station(options.machine, 1, scale, folder, words) as file:
            site = over_tcp(file, port)
            end, clean = await measured(site, folder / "clean", None, 0.0)
            assert end == "ended well", end
            true = read(clean)
            while sum(self.faults.values()) < options.faults and time.monotonic() < self.until:
                spoilt, proxy = behind(site, options.link, dice)
                share = dice.choice((0.3, 1.0, 3.0)) * options.share
                end, at = await measured(spoilt, folder / "spoilt", proxy, share)
                proxy.close()
                self.ends[end] += 1
                self.faults += proxy.faults
                self.judge(read(at), true)

    def judge(self, found: dict[str, Place], true: dict[str, Place]) -> None:
        """Compare readings with those of the clean session."""
        for step, xyz in found.items():
            self.readings += 1
            off = max(abs(a - b) for a, b in zip(xyz, true[step], strict=True))
            if off > self.away_mm:
                self.wrong += 1
                print(f"a reading {off:.3g} mm off was taken at {step}", flush=True)

    async def all(self, folder: Path) -> None:
        """Every line of sessions at once: most of the time they wait."""
        lines = (self.sessions(folder / str(k), k) for k in range(self.options.lines))
        await asyncio.gather(*lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--link", choices=("tracker", "controller"), default="tracker")
    parser.add_argument("--machine", choices=("hexapod", "tripod"), default="hexapod")
    kinds = ("bare", "pose", "geocom", "lines")
    parser.add_argument("--with", dest="kind", choices=kinds, default="", help="another device")
    parser.add_argument("--share", type=float, default=0.05)
    parser.add_argument("--lines", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    trial, said, begun = Trial(options), io.StringIO(), time.monotonic()
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stderr(said):
        os.environ["PKMCAL_STATE"] = str(Path(name) / "state")
        asyncio.run(trial.all(Path(name)))
    ends, spoken = trial.ends, said.getvalue()
    found = sum(n for end, n in ends.items() if end.startswith("FOUND"))
    found += spoken.count("Traceback")
    print(dict(trial.faults.most_common()), dict(ends.most_common()), spoken[-1500:], sep="\n")
    total, sessions = sum(trial.faults.values()), sum(ends.values())
    says = (
        f"{ends['ended well']} ended well, {sessions - ends['ended well'] - found} by a typed "
        f"fault, {found} otherwise; {trial.wrong} of {trial.readings} readings off by more than "
        f"{trial.away_mm} mm"
    )
    print(f"{total} faults in {sessions} sessions, {time.monotonic() - begun:.0f} s: {says}")
    if options.page:
        words = f"wire_faults --link {options.link} --machine {options.machine}"
        words += f" --with {options.kind}" if options.kind else ""
        command = f"{words} --faults {options.faults} --seed {options.seed}"
        ran = f"{total} faults in {sessions} sessions, {options.machine}, "
        ran += f"{options.kind} {options.link}".strip()
        write_row("wire", Row(command, ran, says))
    return 1 if found or trial.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
