"""A mock machine whose legs are motors on a line, and its tracker: the host moves it."""

import contextlib
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomli_w
from line_device import LegsOfWorld, LineServer

from app.files.site import Site, parse_site
from calib.mechanism.rigid import Poses, pose_difference
from mocks.clock import ScaledClock
from mocks.control import ControlServer, Hands
from mocks.hidden.table import Hidden
from mocks.tracker.server import TrackerServer
from mocks.world import World, WorldPlan

SCALE = 600.0


@dataclass
class Lab:
    """A mock machine whose legs are motors on a line, and its tracker."""

    world: World
    motors: LineServer
    tracker: TrackerServer
    control: ControlServer
    folder: Path

    def site(self, **load: float) -> Site:
        return parse_site(self.text(**load), "lab", self.folder)

    def text(self, **load: float) -> str:
        around, own = self.world.around, self.world.load
        table = {
            "format": "pkm-site/1",
            "machine": "hexapod",
            "controller": {
                "kind": "line-motors",
                "address": f"127.0.0.1:{self.motors.port}",
                "store": "store",
            },
            "tracker": {
                "kind": "emscon",
                "address": self.tracker.address,
                "frame": [round(v, 1) for v in self.world.station.frame()],
            },
            "nests": {
                "platform": {k: list(v) for k, v in around.platform_nests.items()},
                "base": {k: list(v) for k, v in around.base_nests.items()},
            },
            "hands": {"kind": "mock", "control": self.control.address, "smrs": 3},
            "load": {
                "platform_mass_kg": own.platform_mass_kg,
                "platform_com": list(own.platform_com),
                "payload_com": list(own.payload_com),
                **load,
            },
            "clock": {"scale": SCALE},
        }
        return tomli_w.dumps(table)

    def misses(self, poses: Poses) -> np.ndarray:
        """How far (N,), um, the platform is from one pose now: the noise-free truth."""
        now = self.world.pose(np.array([self.world.clock.now()]))
        there = Poses(now.position.T, np.moveaxis(now.rotation, 0, -1))
        return 1e3 * np.linalg.norm(pose_difference(poses, there)[:3], axis=0)


@contextlib.asynccontextmanager
async def lab(folder: Path, hidden: Mapping[str, float], seed: int = 7) -> AsyncIterator[Lab]:
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=seed, smrs=3, hidden=Hidden(hidden)))
    machine = world.machine
    axes = LegsOfWorld(world.legs, [float(r) for r in machine.reference()])
    motors = LineServer(axes, [a.limits for a in machine.actuators])
    tracker = TrackerServer(world, clock)
    control = ControlServer(Hands(world, tracker))
    await motors.open()
    await tracker.start()
    await control.start()
    try:
        yield Lab(world, motors, tracker, control, folder)
    finally:
        await control.stop()
        await tracker.stop()
        await motors.close()
