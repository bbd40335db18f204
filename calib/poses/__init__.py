"""Where to measure: reachable poses, the choice among them, their order, and what they will give.

``reach`` draws poses that the machine can take, ``readings`` says what a reading at a pose tells,
``information`` predicts accuracy from it, ``choose`` picks the poses, ``path`` orders them,
``design`` does all of it; ``verification`` lays the grid on which a calibration is judged.
"""

from calib.poses.design import Design, design_poses
from calib.poses.reach import PoseSet, reachable, sample_poses, solve_poses
from calib.poses.verification import VerificationGrid, verification_poses

__all__ = [
    "Design",
    "PoseSet",
    "VerificationGrid",
    "design_poses",
    "reachable",
    "sample_poses",
    "solve_poses",
    "verification_poses",
]
