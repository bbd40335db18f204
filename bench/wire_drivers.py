"""Drivers behind a proxy that spoils what passes, without sessions around them: many faults.

    python -m bench wire_drivers [--on canopen] [--faults 3000] [--seed 1] [--seconds 600] [--page]

The real drivers of a site, each against a mock in a process of its own, over the proxy of
wire_faults: connect, read who and what is there, move and read again, or measure, and leave; again
and again. One fault in fifteen is one that few links outlive. Found are exceptions that are no
typed fault, calls that take longer than a minute, words of a library on the terminal, and
numbers beyond what they can be. Readings, targets and parameters are compared with those of a
clean round; what no check can notice (a digit within the limits, without a checksum) is counted.
"""

import argparse
import asyncio
import contextlib
import io
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from app.demo.station import mock_station
from app.errors import GateRefused
from app.files.site import Site
from app.session.answered import must_be_within_reach, must_belong
from app.session.links import open_controller, open_tracker
from app.session.routines.moving import commanded_coordinates
from bench._reliability_page import Row, write_row
from bench._wire_proxy import ENDING, Proxy
from bench.wire_faults import behind, free_port, over_tcp, poses_of, truth_in
from calib.frames import Frame
from calib.mechanism.rigid import Poses
from drivers import plausible
from drivers.errors import DeviceError, LinkError
from drivers.interface import MotionController, Tracker
from mocks.control import ControlClient

T = TypeVar("T")
HARM = 1.0 / 15.0
SHARES, OF_MANY = (0.05, 0.15, 0.4), (0.005, 0.02, 0.08)
"""How much of what passes is spoilt, in one round after another; of links of many small frames."""
LONGEST_S, ARRIVAL_S = 60.0, 20.0
TRIES = 5
DWELL_S, DWELLS = 0.5, 6
NEST = "3"
SAME_MM, SAME = 0.01, 1e-9
"""Targets nearer to those of the clean round than this (mm, rad) are the same; parameters."""


@dataclass(frozen=True)
class On:
    """A link: the mock's words, its machine and scale, and how far a reading may be off (mm)."""

    link: str
    machine: str = "hexapod"
    words: tuple[str, ...] = ()
    scale: float = 600.0
    away_mm: float = 0.2
    shares: tuple[float, ...] = SHARES


LINKS = {
    "emscon": On("tracker"),
    "geocom": On("tracker", words=("--geocom",), scale=300.0, away_mm=2.0),
    "lines": On("tracker", words=("--lines",), scale=40.0),
    "canopen": On("controller", shares=OF_MANY),
    "gcs": On("controller", "tripod"),
    "pose": On("controller", words=("--pose",)),
    "bare": On("controller", words=("--bare",), shares=OF_MANY),
}


@dataclass
class Said:
    """What one round heard: readings (mm), targets by pose, parameters, channels."""

    readings: list[tuple[float, ...]] = field(default_factory=list)
    targets: dict[str, tuple[float, ...]] = field(default_factory=dict)
    positions: dict[str, tuple[float, ...]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    channels: list[Mapping[str, float]] = field(default_factory=list)


@dataclass
class Trial:
    """Rounds on one kind of link, and what came of them."""

    name: str
    options: argparse.Namespace
    ends: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    other: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    numbers: int = 0
    longest: tuple[float, str] = (0.0, "")

    def __post_init__(self) -> None:
        self.on = LINKS[self.name]
        self.until = 0.0

    async def timed(self, what: str, deed: Awaitable[T]) -> T:
        """A call that must end within a minute; the longest is remembered."""
        begun = time.monotonic()
        try:
            async with asyncio.timeout(LONGEST_S):
                return await deed
        except TimeoutError:
            self.found[f"{what}: no end within {LONGEST_S:g} s"] += 1
            raise
        finally:
            self.longest = max(self.longest, (time.monotonic() - begun, what))

    async def rounds(self, site: Site, number: int) -> None:
        """One mock: a clean round, then spoilt ones until there were enough faults."""
        dice = random.Random(f"{self.options.seed} {self.name} {number}")
        place = _nest(site) if self.on.link == "tracker" else (0.0, 0.0, 0.0)
        clean = await self._clean(site, place)
        while sum(self.faults.values()) < self.options.faults and time.monotonic() < self.until:
            spoilt, proxy = behind(site, self.on.link, dice, HARM)
            proxy.spoil(dice.choice(self.on.shares))
            said = Said()
            self.ends[await self._ended(spoilt, place, said, proxy)] += 1
            self.faults += proxy.faults
            self.judge(said, clean)

    async def _clean(self, site: Site, place: tuple[float, float, float]) -> Said:
        """A round as it is; a busy computer may be too late for a deadline."""
        for _ in range(TRIES):
            clean = Said()
            with contextlib.suppress(LinkError):
                await self.round(site, place, clean)
                return clean
        raise SystemExit(f"{self.name}: no clean round in {TRIES} tries")

    async def _ended(
        self, site: Site, place: tuple[float, float, float], said: Said, proxy: Proxy
    ) -> str:
        try:
            await self.round(site, place, said)
        except DeviceError as fault:
            if not fault.remedy:
                self.found[f"no remedy: {type(fault).__name__}: {fault.what[:80]}"] += 1
            return type(fault).__name__
        except GateRefused as refused:
            return type(refused).__name__
        except TimeoutError:
            return "no end"
        except Exception as error:
            self.found[f"{type(error).__name__}: {str(error)[:120]}"] += 1
            return type(error).__name__
        finally:
            proxy.spoil(0.0)
            proxy.close()
        return "ended well"

    async def round(self, site: Site, place: tuple[float, float, float], said: Said) -> None:
        """Connect, do what the device is for, and leave."""
        if self.on.link == "tracker":
            tracker = await self.timed("connect", open_tracker(site))
            try:
                await self._measure(tracker, site, place, said)
            finally:
                await self.timed("close", tracker.close())
        else:
            controller = await self.timed("connect", open_controller(site))
            try:
                await self._move(controller, site, said)
            finally:
                await self.timed("close", controller.close())

    async def _measure(
        self, tracker: Tracker, site: Site, place: tuple[float, float, float], said: Said
    ) -> None:
        await self.timed("initialize", tracker.initialize())
        if tracker.can.reflectors:
            await self.timed("reflector", tracker.select_reflector(site.tracker.reflector))
        for _ in range(DWELLS):
            if tracker.can.points:
                await self.timed("point", tracker.point_at(place))
            reading = await self.timed("measure", tracker.measure(DWELL_S))
            said.readings.append(reading.xyz)
            said.channels.append(await self.timed("channels", tracker.channels()))
            await self.timed("state", tracker.state())
            tracker.check()

    async def _move(self, controller: MotionController, site: Site, said: Said) -> None:
        machine = site.machine
        with contextlib.suppress(DeviceError):  # the last round may have ended in a fault
            controller.check()
        await self.timed("clear", controller.clear_faults())
        said.parameters.update(await self.timed("parameters", controller.read_parameters()))
        await self.timed("checksum", controller.parameter_checksum())
        await self.timed("enable", controller.enable())
        for actuator in (await self.timed("state", controller.state())).actuators:
            if not actuator.homed:
                await self.timed("home", controller.home(actuator.name))
        for label, pose in poses_of(site).items():
            coordinates = commanded_coordinates(machine, pose)
            targets = await self.timed("move", controller.move_to_pose(coordinates))
            if not site.controller.hosted:
                must_belong(machine, said.parameters, pose, targets)
            said.targets[label] = targets
            await self.timed("arrive", controller.wait_arrived(ARRIVAL_S))
            state = await self.timed("state", controller.state())
            q = tuple(actuator.position for actuator in state.actuators)
            must_be_within_reach(machine, q)
            said.positions[label] = q
            channels = await self.timed("channels", controller.channels())
            plausible.channels(channels, "controller")
            said.channels.append(channels)
            controller.check()
        await self.timed("stop", controller.stop())

    def judge(self, said: Said, clean: Said) -> None:
        """Compare with a clean round: what is beyond the limits is found, what is other counted."""
        self.numbers += 3 * len(said.readings) + len(said.parameters)
        if clean.readings:
            true = np.median(np.array(clean.readings), axis=0)
            for xyz in said.readings:
                self._other("readings", float(np.abs(xyz - true).max()), self.on.away_mm)
        pairs = ((said.targets, clean.targets), (said.positions, clean.positions))
        for what, (here, there) in zip(("targets", "positions"), pairs, strict=True):
            for label, q in here.items():
                self.numbers += len(q)
                off = max(abs(a - b) for a, b in zip(q, there[label], strict=True))
                self._other(what, off, SAME_MM)
        for name, value in said.parameters.items():
            self._other("parameters", abs(value - clean.parameters[name]), SAME)
        for channels in said.channels:
            self.numbers += len(channels)
            for name, value in channels.items():
                if not abs(value) <= plausible.CHANNEL:
                    self.found[f"channel {name} {value:g}"] += 1
                self._other("channels", abs(value - clean.channels[0].get(name, value)), 50.0)

    def _other(self, what: str, off: float, most: float) -> None:
        if not off <= most:
            self.other[what] += 1
            print(f"{self.name}: {what} off by {off:.6g} were taken", flush=True)

    def all(self, folder: Path) -> None:
        """Several mocks at once: most of the time they wait."""
        with contextlib.ExitStack() as stack:
            sites = []
            for number in range(self.options.lines):
                own = folder / str(number)
                own.mkdir()
                port = free_port()
                words = ["--truth", str(truth_in(own / "truth")), "--controller-port", str(port)]
                words += self.on.words
                station = mock_station(self.on.machine, 1, self.on.scale, own, words)
                sites.append(over_tcp(stack.enter_context(station), port))
            self.until = time.monotonic() + self.options.seconds
            asyncio.run(self._together(sites))

    async def _together(self, sites: list[Site]) -> None:
        await asyncio.gather(*(self.rounds(site, k) for k, site in enumerate(sites)))

    def says(self, spoken: str) -> str:
        """What is to be said on the page."""
        well = self.ends["ended well"]
        typed = sum(self.ends.values()) - well - sum(self.found.values())
        others = ", ".join(f"{n} {what}" for what, n in sorted(self.other.items())) or "none"
        wrong = sum(self.found.values()) + spoken.count("Traceback")
        return (
            f"{well} ended well, {max(typed, 0)} by a typed fault, {wrong} otherwise; longest call "
            f"{self.longest[0]:.1f} s; of {self.numbers} numbers other ones within the limits: "
            f"{others}"
        )


def _nest(site: Site) -> tuple[float, float, float]:
    """Where the SMR of one nest should be in the room, the machine at home; it is brought there."""
    hands = ControlClient(f"{site.hands.host}:{site.hands.port}")
    hands("carry", nest=NEST)
    hands.close()
    at = Poses.from_xyz_rpy(np.array(site.machine.home, float)[:, None])
    point = at.rotation[:, :, 0] @ np.array(site.platform_nests[NEST]) + at.position[:, 0]
    x, y, z = Frame.of(site.tracker.frame).apply(point)
    return float(x), float(y), float(z)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--on", choices=tuple(LINKS), default="canopen")
    parser.add_argument("--faults", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lines", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    trial, spoken, begun = Trial(options.on, options), io.StringIO(), time.monotonic()
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stderr(spoken):
        os.environ["PKMCAL_STATE"] = str(Path(name) / "state")
        trial.all(Path(name))
    words = spoken.getvalue()
    says, total = trial.says(words), sum(trial.faults.values())
    harmful = sum(trial.faults[fault] for fault in ENDING)
    print(dict(trial.faults.most_common()), dict(trial.ends.most_common()), sep="\n")
    print(
        *(f"FOUND {n} x {what}" for what, n in trial.found.most_common()), words[-1500:], sep="\n"
    )
    print(f"{total} faults, {time.monotonic() - begun:.0f} s, longest {trial.longest}: {says}")
    if options.page:
        ran = f"{total} faults ({harmful} of the six kinds that break) in "
        ran += f"{sum(trial.ends.values())} rounds, {options.on}, the driver alone"
        command = f"wire_drivers --on {options.on} --faults {options.faults} --seed {options.seed}"
        write_row("wire", Row(command, ran, says))
    return 1 if trial.found or "Traceback" in words else 0


if __name__ == "__main__":
    sys.exit(main())
