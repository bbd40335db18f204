"""What to command so that the platform comes to where it is wanted, with every machine effect.

``identified`` is the machine as a fit found it; ``standing`` where its platform is at given
commands; ``solver`` the commands for wanted poses (``aiming``: the machine closed at them,
``changes``: what the effects change there), ``trajectory`` for a stream of them (``course``: what
comes next); ``history`` what was commanded before; ``surroundings`` what the machine carries, how
warm it is, and when, ``told`` all of that of a call; ``region`` where a model was measured;
``uncertainty`` how sure it is. Derivation: docs/commands.md.
"""

from calib.command.history import History
from calib.command.identified import Found, Identified
from calib.command.region import Excess, Region
from calib.command.solver import Commands, commands_for, pose_commands
from calib.command.standing import Standpoint, standpoint
from calib.command.surroundings import Surroundings
from calib.command.trajectory import Trajectory
from calib.command.uncertainty import PoseCovariance

__all__ = [
    "Commands",
    "Excess",
    "Found",
    "History",
    "Identified",
    "PoseCovariance",
    "Region",
    "Standpoint",
    "Surroundings",
    "Trajectory",
    "commands_for",
    "pose_commands",
    "standpoint",
]
