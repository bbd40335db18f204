"""A station whose controller is LinuxCNC itself, in this process."""

import contextlib
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from calib.effects.struts import struts_of
from calib.mechanism.rigid import Poses, pose_difference
from calib.mechanism.solve import inverse
from drivers.kind import ActuatorFacts, Strut, Surroundings
from drivers.linuxcnc.controller import LinuxCncController
from drivers.linuxcnc.kind import KIND
from drivers.linuxcnc.places import Places
from mocks.clock import ScaledClock
from mocks.hidden.table import Hidden
from mocks.linuxcnc.body import StrutsBody
from mocks.linuxcnc.server import LinuxCncStation
from mocks.linuxcnc.site import linuxcnc_site
from mocks.world import World, WorldPlan

MACHINE = StrutsBody().machine
NOMINAL = {p.name: p.nominal for p in MACHINE.parameters}
STRUTS = tuple(Strut(**vars(strut)) for strut in struts_of(MACHINE))
FOLLOWED_S = 0.3
"""Wall seconds after which the true machine surely stands where the motors do."""


def places() -> Places:
    return Places.of(tuple(NOMINAL), STRUTS)


class Bench:
    """World and LinuxCNC; drivers that are opened are closed by who opened them."""

    def __init__(self, folder: Path, lead: float = 0.0, seed: int = 5) -> None:
        hidden = Hidden({"screw-twist.L": lead} if lead else {})
        plan = WorldPlan(seed=seed, body=StrutsBody(), hidden=hidden)
        self.world = World(ScaledClock(1.0), plan)
        self.station = LinuxCncStation(self.world, folder, 4711)

    def around(self, **stated: Any) -> Surroundings:
        told = {**linuxcnc_site(self.station.program), **stated}
        settings = {one.name: told.get(one.name, one.default) for one in KIND.settings}
        if isinstance(settings["restart"], str):
            settings["restart"] = settings["restart"].split()
        facts = tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in MACHINE.actuators)
        return Surroundings(settings, "", "linuxcnc", facts, NOMINAL, struts=STRUTS)

    @contextlib.asynccontextmanager
    async def driver(self, **stated: Any) -> AsyncIterator[LinuxCncController]:
        controller = await LinuxCncController.connect(self.around(**stated))
        try:
            yield controller
        finally:
            await controller.close()

    def off_um(self, pose: tuple[float, ...]) -> float:
        """Distance of the true platform from a commanded pose, um."""
        stands = self.world.pose(np.array([self.world.clock.now()]))
        true = Poses(stands.position.T, stands.rotation.transpose(1, 2, 0))
        wanted = Poses.from_xyz_rpy(np.array(pose)[:, None])
        return 1e3 * float(np.linalg.norm(pose_difference(wanted, true)[:3]))


@contextlib.contextmanager
def running(folder: Path, lead: float = 0.0) -> Iterator[Bench]:
    bench = Bench(folder, lead)
    bench.station.start()
    try:
        yield bench
    finally:
        bench.station.stop()


async def ready(controller: LinuxCncController) -> None:
    """On, and every joint homed."""
    await controller.enable()
    for actuator in (await controller.state()).actuators:
        if not actuator.homed:
            await controller.home(actuator.name)


async def keep_moving(controller: LinuxCncController) -> None:
    for pose in some_poses(20, seed=3):
        await controller.move_to_pose(pose)
        await controller.wait_arrived(20.0)


def some_poses(count: int, seed: int) -> list[tuple[float, ...]]:
    generator = np.random.default_rng(seed)
    spread = np.array([9.0, 9.0, 9.0, 0.1, 0.1, 0.1])
    return [tuple(map(float, row)) for row in generator.uniform(-spread, spread, (count, 6))]


def lengths_at(pose: tuple[float, ...], values: dict[str, float]) -> np.ndarray:
    """q of our own kinematics, mm."""
    vector = MACHINE.vector({p.name: values[p.name] for p in MACHINE.parameters})
    closed = inverse(MACHINE, Poses.from_xyz_rpy(np.array(pose)[:, None]), vector)
    return closed.extension[:, 0] + [values[f"leg{n}.L0"] for n in range(1, 7)]
