"""What to command so that the platform comes to where it is wanted, with every machine effect.

``identified`` is the machine as a fit found it; ``standing`` where its platform is at given
commands; ``solver`` the commands for wanted poses, ``trajectory`` for a stream of them; ``history``
what was commanded before; ``surroundings`` what the machine carries, how warm it is, and when;
``region`` where a model was measured; ``uncertainty`` how sure it is. Derivation: docs/commands.md.
"""

from calib.command.history import History
from calib.command.identified import Found, Identified
from calib.command.region import Excess, Region
from calib.command.solver import Commands, commands_for, pose_commands
from calib.command.standing import Standpoint, standpoint
from calib.command.surroundings import Surroundings
from calib.command.trajectory import Trajectory
from calib.command.uncertainty import pose_covariance

__all__ = [
    "Commands",
    "Excess",
    "Found",
    "History",
    "Identified",
    "Region",
    "Standpoint",
    "Surroundings",
    "Trajectory",
    "commands_for",
    "pose_commands",
    "pose_covariance",
    "standpoint",
]
