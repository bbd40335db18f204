"""What every driver must hold, shipped or foreign: laws that a test runs, one after the other.

A driver's author describes a bench (a device, or a mock of one, that stands ready) and runs all
laws of its sort over it (:data:`TRACKER_LAWS`, :data:`CONTROLLER_LAWS`, :data:`MOTORS_LAWS`,
:data:`POSE_LAWS`); docs/write-a-driver.md shows how. A law that needs what the device cannot, or
what the bench cannot do to it, is not run; :func:`why_not` says why.
"""

from drivers.contract.bench import (
    ControllerBench,
    Law,
    MotorsBench,
    PoseBench,
    TrackerBench,
    why_not,
)
from drivers.contract.controllers import CONTROLLER_LAWS
from drivers.contract.motors import MOTORS_LAWS
from drivers.contract.pose_movers import POSE_LAWS
from drivers.contract.trackers import TRACKER_LAWS

__all__ = [
    "CONTROLLER_LAWS",
    "MOTORS_LAWS",
    "POSE_LAWS",
    "TRACKER_LAWS",
    "ControllerBench",
    "Law",
    "MotorsBench",
    "PoseBench",
    "TrackerBench",
    "why_not",
]
