"""A plan is data: numbered steps with stable identifiers, expanded before the start.

The engine only interprets. A plan is stored with the session, so that it can be read years later
and so that a killed session goes on with exactly the steps that it began.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from app.files.pose_table import Pose
from calib.errors import BadInput

FORMAT = "pkm-plan/1"


@dataclass(frozen=True)
class Step:
    """One step: ``kind`` names the routine that does it, ``args`` is all that it needs to know.

    ``id`` is stable: number in the plan and what it is about, ``"0042-read-p07-4"``.
    """

    id: str
    kind: str
    says: str
    args: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Plan:
    """Numbered steps over labelled poses (x, y, z mm; rx, ry, rz rad; platform in base frame).

    ``purpose`` is ``measure`` or ``verify``.
    """

    purpose: str
    title: str
    machine: str
    poses: Mapping[str, Pose]
    steps: tuple[Step, ...]

    def to_json(self) -> str:
        """Render the plan as JSON text."""
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=1)

    @staticmethod
    def from_json(text: str, source: str) -> "Plan":
        """Read a plan back; raises :class:`BadInput` if the text is not one."""
        try:
            data = json.loads(text)
            if data["format"] != FORMAT:
                raise ValueError(f"format {data['format']!r}")
            return Plan(
                purpose=data["purpose"],
                title=data["title"],
                machine=data["machine"],
                poses={label: _pose(pose) for label, pose in data["poses"].items()},
                steps=tuple(Step(**step) for step in data["steps"]),
            )
        except (ValueError, KeyError, TypeError) as error:
            raise BadInput(
                f"not a plan of this program ({error})", place=source, remedy="Measure anew"
            ) from error


class PlanWriter:
    """Collects steps and numbers them."""

    def __init__(self) -> None:
        self.steps: list[Step] = []

    def add(self, kind: str, about: str, says: str, **args: Any) -> None:
        """Append a step; ``about`` goes into its identifier."""
        number = f"{len(self.steps) + 1:04d}"
        parts = [number, kind, about] if about else [number, kind]
        self.steps.append(Step("-".join(parts), kind, says, args))


def _pose(values: Any) -> Pose:
    x, y, z, rx, ry, rz = (float(value) for value in values)
    return x, y, z, rx, ry, rz
