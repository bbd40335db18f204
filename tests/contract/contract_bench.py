"""The shipped drivers on their benches: mocks on real wires, one for each law."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from calib.effects.struts import struts_of
from drivers.canopen import CanopenController
from drivers.contract import ControllerBench, MotorsBench, PoseBench, TrackerBench
from drivers.drives.kind import KIND as DRIVES
from drivers.emscon import EmsconTracker
from drivers.emscon.settings import EmsconSettings
from drivers.gcs import GcsController
from drivers.gcs.pose_kind import KIND as POSE
from drivers.geocom.kind import KIND as GEOCOM
from drivers.interface import MotionController, Motors, PoseMover, Tracker
from drivers.kind import ActuatorFacts, Strut, Surroundings
from drivers.lines.kind import KIND as LINES
from drivers.linuxcnc.kind import KIND as LINUXCNC
from drivers.operator.motors import PersonMoves
from mocks.canopen.bare_site import bare_site
from mocks.canopen.server import CanopenStation
from mocks.clock import ScaledClock
from mocks.gcs.server import GcsStation
from mocks.geocom.server import GeoComServer
from mocks.linuxcnc.body import StrutsBody
from mocks.linuxcnc.server import LinuxCncStation
from mocks.linuxcnc.site import linuxcnc_site
from mocks.tracker.lines import LineServer
from mocks.tracker.server import TrackerServer
from mocks.world import World, WorldPlan

SCALE = 200.0
LONGEST_S = 20.0
HOMES = {
    "hexapod": ((0.0, 0.0, 220.0), (0.0, 0.0, 206.0)),
    "tripod": ((0.0, 0.0, -121.24355652982142), (10.0, -20.0, -150.0)),
}


@contextlib.asynccontextmanager
async def emscon_bench() -> AsyncIterator[TrackerBench]:
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=4, smrs=3))
    server = TrackerServer(world, clock)
    await server.start()

    async def connect() -> Tracker:
        settings = EmsconSettings(margin_s=1.0)
        return await EmsconTracker.connect(server.address, SCALE, settings)

    async def target() -> tuple[float, float, float]:
        x, y, z = world.nest_in_tracker("3", np.array([clock.now()]))[0]
        return float(x), float(y), float(z)

    async def hide() -> None:
        server.instrument.break_beam()

    async def silence() -> None:
        world.faults.inject("tracker-silent")

    try:
        yield TrackerBench(connect, LONGEST_S, target, hide, silence)
    finally:
        await server.stop()


@contextlib.asynccontextmanager
async def controller_bench(machine: str, folder: Path) -> AsyncIterator[ControllerBench]:
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(machine=machine, seed=4))
    on_gcs = machine == "tripod"
    station = (GcsStation if on_gcs else CanopenStation)(world, folder / "nvm.json")
    facts = tuple(
        ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in load_machine(machine).actuators
    )
    here, there = ((*place, 0.0, 0.0, 0.0) for place in HOMES[machine])

    async def connect() -> MotionController:
        host, port = station.address
        channel = f"socket://{host}:{port}"
        if on_gcs:
            return await GcsController.connect(channel)
        return await CanopenController.connect("slcan", channel, machine=machine)

    async def silence() -> None:
        world.faults.inject("controller-silent" if on_gcs else "heartbeat-silent:10")

    station.start()
    try:
        yield ControllerBench(
            open=connect,
            longest_s=LONGEST_S,
            actuators=facts,
            poses=(here, there),
            unreachable=(0.0, 0.0, 5000.0, 0.0, 0.0, 0.0),
            parameter="limb1.h" if on_gcs else "leg1.B_x",
            silence=silence,
        )
    finally:
        station.stop()


@contextlib.asynccontextmanager
async def pose_bench() -> AsyncIterator[PoseBench]:
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=4))
    station = GcsStation(world, pose=True)

    async def connect() -> PoseMover:
        host, port = station.address
        stated = {"port": f"socket://{host}:{port}", "rotation": "Rx Ry Rz"}
        stated["origin"] = (0.0, 0.0, 220.0)
        settings = {one.name: stated.get(one.name, one.default) for one in POSE.settings}
        return await POSE.open(Surroundings(settings, "", "hexapod", (), {}, SCALE))

    async def silence() -> None:
        world.faults.inject("controller-silent")

    station.start()
    try:
        yield PoseBench(
            open=connect,
            longest_s=LONGEST_S,
            poses=((0.0, 0.0, 220.0, 0.0, 0.0, 0.0), (3.0, -8.0, 206.0, 0.1, -0.08, 0.15)),
            unreachable=(0.0, 0.0, 5000.0, 0.0, 0.0, 0.0),
            silence=silence,
        )
    finally:
        station.stop()


@contextlib.asynccontextmanager
async def motors_bench(mode: str = "profile") -> AsyncIterator[MotorsBench]:
    """Bare drives on a machine whose moves between the places take a second of wall time."""
    clock = ScaledClock(1.0)
    world = World(clock, WorldPlan(seed=4))
    station = CanopenStation(world, bare=True)
    facts = tuple(
        ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in load_machine("hexapod").actuators
    )
    home = tuple(fact.home for fact in facts)
    ways = (16.0, -3.0, 9.0, 12.0, -7.0, 5.0)

    async def connect() -> Motors:
        host, port = station.address
        stated = bare_site(world, f"socket://{host}:{port}", station.serials) | {"mode": mode}
        stated["eds"] = [stated["eds"]]
        settings = {one.name: stated.get(one.name, one.default) for one in DRIVES.settings}
        return await DRIVES.open(Surroundings(settings, "", "hexapod", facts, {}, 1.0))

    async def silence() -> None:
        world.faults.inject("heartbeat-silent:3")

    async def stall() -> None:
        world.legs[-1].stalled = True

    station.start()
    try:
        yield MotorsBench(
            open=connect,
            longest_s=LONGEST_S,
            actuators=facts,
            places=(home, tuple(map(sum, zip(home, ways, strict=True)))),
            unreachable=(*home[:-1], facts[-1].limits[1] + 1.0),
            silence=silence,
            stall=stall,
        )
    finally:
        station.stop()


@contextlib.asynccontextmanager
async def linuxcnc_bench(folder: Path) -> AsyncIterator[ControllerBench]:
    """LinuxCNC itself, at a speed at which the way between the poses takes a second or two."""
    world = World(ScaledClock(1.0), WorldPlan(seed=4, body=StrutsBody()))
    station = LinuxCncStation(world, folder, 4711)
    facts = tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in world.machine.actuators)
    struts = tuple(Strut(**vars(strut)) for strut in struts_of(world.machine))
    nominal = {p.name: p.nominal for p in world.machine.parameters}

    async def connect() -> MotionController:
        stated = {**linuxcnc_site(station.program), "speed_mm_s": 8.0}
        settings = {one.name: stated.get(one.name, one.default) for one in LINUXCNC.settings}
        settings["restart"] = stated["restart"].split()
        around = Surroundings(settings, "4711", "linuxcnc", facts, nominal, struts=struts)
        return await LINUXCNC.open(around)

    async def silence() -> None:
        station.cut()

    station.start()
    try:
        yield ControllerBench(
            open=connect,
            longest_s=3.0 * LONGEST_S,
            actuators=facts,
            poses=((0.0, 0.0, 1.0, 0.0, 0.0, 0.0), (2.0, -3.0, -14.0, 0.02, 0.0, 0.03)),
            unreachable=(0.0, 0.0, 5000.0, 0.0, 0.0, 0.0),
            parameter="leg1.B_x",
            silence=silence,
        )
    finally:
        station.stop()


@contextlib.asynccontextmanager
async def lines_bench() -> AsyncIterator[TrackerBench]:
    """A tracker that sends lines on TCP, through the kind of site files."""
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=4, smrs=3))
    server = LineServer(world, clock)
    await server.start()
    stated = {"source": server.address, "sigma_mm": 0.005, "silence_s": 1.0, "unit": "mm"}
    settings = {one.name: stated.get(one.name, one.default) for one in LINES.settings}

    async def connect() -> Tracker:
        return await LINES.open(Surroundings(settings, "", "hexapod", (), {}, SCALE))

    async def target() -> tuple[float, float, float]:
        x, y, z = world.smr_in_tracker("smr1", np.array([clock.now()]))[0]
        return float(x), float(y), float(z)

    async def hide() -> None:
        world.faults.inject("tracker-lost")

    async def silence() -> None:
        world.faults.inject("tracker-silent")

    try:
        yield TrackerBench(connect, LONGEST_S, target, hide, silence)
    finally:
        await server.stop()


@contextlib.asynccontextmanager
async def geocom_bench() -> AsyncIterator[TrackerBench]:
    """A total station."""
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=4, smrs=3))
    server = GeoComServer(world, clock)
    await server.start()
    stated = {"port": server.address, "sigma_arcsec": 0.6, "sigma_distance_mm": 0.26}
    settings = {one.name: stated.get(one.name, one.default) for one in GEOCOM.settings}
    settings["margin_s"] = 1.0

    async def connect() -> Tracker:
        return await GEOCOM.open(Surroundings(settings, "", "hexapod", (), {}, SCALE))

    async def target() -> tuple[float, float, float]:
        x, y, z = world.nest_in_tracker("3", np.array([clock.now()]))[0]
        return float(x), float(y), float(z)

    async def hide() -> None:
        world.faults.inject("tracker-lost")

    async def silence() -> None:
        world.faults.inject("tracker-silent")

    try:
        yield TrackerBench(connect, LONGEST_S, target, hide, silence)
    finally:
        await server.stop()


TRACKERS: dict[str, Callable[..., contextlib.AbstractAsyncContextManager[TrackerBench]]] = {
    "emscon": emscon_bench,
    "geocom": geocom_bench,
    "lines": lines_bench,
}
CONTROLLERS = {"canopen": "hexapod", "gcs": "tripod"}
POSE_MOVERS = {"pose": pose_bench}
BY_HAND_S = 0.2
"""How long the person of the bench takes."""


@contextlib.asynccontextmanager
async def by_hand_bench() -> AsyncIterator[MotorsBench]:
    """A person who does what is asked."""
    machine = load_machine("hexapod")
    facts = tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in machine.actuators)
    home = tuple(fact.home for fact in facts)

    async def ask(text: str, choices: tuple[str, ...], typed: str) -> str:
        await asyncio.sleep(BY_HAND_S)
        return choices[0]

    async def connect() -> Motors:
        person = PersonMoves(facts)
        person.ask = ask
        return person

    yield MotorsBench(
        open=connect,
        longest_s=LONGEST_S,
        actuators=facts,
        places=(home, tuple(value + 5.0 for value in home)),
        unreachable=(*home[:-1], facts[-1].limits[1] + 1.0),
    )


MOTORS = {
    "drives": motors_bench,
    "drives, cyclic": partial(motors_bench, "cyclic"),
    "operator": by_hand_bench,
}
