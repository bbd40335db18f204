"""The beam: where it points, which SMR it follows, whether somebody stands in it."""

import numpy as np

from mocks.physics.pose import Array
from mocks.world import World

DEFAULT_RADIUS_MM = 20.0


class Beam:
    """State of the beam. ``locked`` names the SMR that it follows, None if it follows none."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.aim: Array = world.smr_in_tracker("home", np.zeros(1))[0]
        self.locked: str | None = None
        self.interrupted = False
        self.radius_mm = DEFAULT_RADIUS_MM

    def here(self) -> Array:
        """Where the beam points now, tracker frame, (3,), mm."""
        if self.locked is not None:
            now = np.array([self._world.clock.now()])
            self.aim = self._world.smr_in_tracker(self.locked, now)[0]
        return self.aim

    def search(self, aim: Array, radius_mm: float | None = None) -> bool:
        """Point at ``aim`` (3,) and lock on the SMR nearest to the beam there, if there is one."""
        self.locked = None
        self.aim = np.asarray(aim, dtype=float)
        if self.interrupted:
            return False
        along = self.aim / np.linalg.norm(self.aim)
        nearest, best = None, self.radius_mm if radius_mm is None else radius_mm
        for smr, point in self._world.all_smrs(self._world.clock.now()).items():
            off = float(np.linalg.norm(point - (point @ along) * along))
            if point @ along > 0.0 and off <= best:
                nearest, best = smr, off
        self.locked = nearest
        return nearest is not None

    def interrupt(self) -> None:
        """Somebody steps into the beam: it keeps pointing where it was broken."""
        self.here()
        self.locked = None
        self.interrupted = True

    def free(self) -> bool:
        """Nobody is in the beam any more; returns whether it has caught an SMR again."""
        self.interrupted = False
        return self.search(self.aim)
