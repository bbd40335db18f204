"""What the machine stands on, as far as something hidden makes it give way."""

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load
from mocks.physics.body import Body
from mocks.physics.pose import Array, Pose, rotation_from_vector


class Stand:
    """Moves the whole machine under its weight; nothing where nothing of the kind is hidden."""

    def __init__(self, hidden: Hidden, body: Body, load: Load) -> None:
        every = hidden.physics(body.limbs, body.stroke)
        self._yields = [one.stand for one in every if one.stand is not None]
        self._load = load

    def under(self, pose: Pose, payload: Array) -> Pose:
        """Where the platform is once the stand has given way; ``payload`` (N,) kg."""
        if not self._yields:
            return pose
        wrench = self._load.wrench(pose.rotation, payload)
        force = wrench[:, :3]
        moment = wrench[:, 3:] + np.cross(pose.position, force)
        motion = sum((one(force, moment) for one in self._yields), np.zeros(wrench.shape))
        turn = rotation_from_vector(motion[:, 3:])
        position = np.einsum("nij,nj->ni", turn, pose.position) + motion[:, :3]
        return Pose(position, turn @ pose.rotation)
