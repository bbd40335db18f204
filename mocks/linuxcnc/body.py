"""The hexapod that genhexkins can hold: universal joints whose axes meet, home at the origin."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load
from mocks.physics.body import Place, TrueMachine
from mocks.physics.circumstances import Circumstances
from mocks.physics.hexapod import HOME_Z
from mocks.physics.hexapod_body import AROUND, HexapodBody
from mocks.physics.hexapod_legs import LIMBS
from mocks.physics.pose import Array, Pose
from mocks.physics.truth import machine_file

MACHINE = "linuxcnc"
DOWN = np.array([0.0, 0.0, -HOME_Z])
"""From the closed form's base frame, which lies in the base joints, to this machine's."""


class _Lowered:
    """A hexapod in a base frame that lies at its home."""

    def __init__(self, real: TrueMachine) -> None:
        self._real = real

    def home(self, count: int) -> Pose:
        """``count`` copies of the nominal home pose."""
        return _moved(self._real.home(count), DOWN)

    def poses(self, c: Circumstances, start: Pose) -> Pose:
        """Poses at N instants from what the legs do, hidden errors included."""
        return _moved(self._real.poses(c, _moved(start, -DOWN)), DOWN)


class StrutsBody(HexapodBody):
    """Six struts between universal joints without offsets."""

    def __init__(self) -> None:
        super().__init__()
        self.machine = machine_file(MACHINE)
        nests = {name: (x, y, z + float(DOWN[2])) for name, (x, y, z) in AROUND.base_nests.items()}
        # The tracker stands as far above the base as with the other hexapod.
        low, high = (height - float(DOWN[2]) for height in AROUND.place.height)
        self.around = replace(AROUND, base_nests=nests, place=Place(height=(low, high)))

    def commanded(self, held: Mapping[str, float], poses: Array) -> Array:
        """Leg lengths at poses (N, 6)."""
        raised = np.array(poses, dtype=float)
        raised[:, :3] -= DOWN
        return super().commanded(_of_hexapod(held), raised)

    def real(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> TrueMachine:
        """A hexapod with these true parameters."""
        return _Lowered(super().real(_of_hexapod(parameters), hidden, load, settles))


def _moved(pose: Pose, by: Array) -> Pose:
    return Pose(pose.position + by, pose.rotation)


def _of_hexapod(values: Mapping[str, float]) -> dict[str, float]:
    """The same struts as the hexapod's parameters, from base joints at z = 0."""
    found = {f"{leg}.L_{body}": 0.0 for leg in LIMBS for body in "BP"} | dict(values)
    return found | {f"{leg}.B_z": values[f"{leg}.B_z"] - float(DOWN[2]) for leg in LIMBS}
