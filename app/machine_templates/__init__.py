"""New machine files: a few questions, and a commented file that closes and can be refined."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.machine_templates.arm import arm_file
from app.machine_templates.common import Questions
from app.machine_templates.delta import delta_file
from app.machine_templates.hexapod import hexapod_file
from app.machine_templates.linuxcnc import linuxcnc_file
from app.machine_templates.own import own_file


@dataclass(frozen=True)
class Template:
    """A kind of machine: what it is, and the text that answers make of it."""

    name: str
    says: str
    render: Callable[[str, Questions], str]


TEMPLATES: Sequence[Template] = (
    Template("hexapod", "six legs that grow (6-UPS, a Stewart platform)", hexapod_file),
    Template("delta", "three carriages on towers with two rods each", delta_file),
    Template("arm", "a serial arm with six axes", arm_file),
    Template("linuxcnc", "six struts as LinuxCNC's genhexkins has them", linuxcnc_file),
    Template("own", "equal limbs around a circle, with joints of your own", own_file),
)

__all__ = ["TEMPLATES", "Questions", "Template"]
