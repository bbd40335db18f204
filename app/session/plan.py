"""A plan is data: numbered steps with stable identifiers, expanded before the start.

The engine only interprets. A plan is stored with the session, so that it can be read years later
and so that a killed session goes on with exactly the steps that it began.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.files.pose_table import HOME, Pose
from app.session.kinds import StepKind, kind_named
from calib.errors import BadInput

FORMAT = "pkm-plan/1"


@dataclass(frozen=True)
class Step:
    """One step: ``kind`` decides which routine does it, ``args`` is all that it needs to know.

    ``id`` is stable: number in the plan and what it is about, ``"0042-read-p07-4"``.
    """

    id: str
    kind: StepKind
    says: str
    args: Mapping[str, Any] = field(default_factory=dict)

    @property
    def goal(self) -> str | None:
        """Label of the pose where the machine stands after it; None where it moves nothing."""
        return self.way[-1] if self.way else None

    @property
    def way(self) -> tuple[str, ...]:
        """Labels of all poses to which it goes, in order; a round may be gone several times."""
        match self.kind.moves_to:
            case "pose":
                return (str(self.args["pose"]),)
            case "home":
                return (HOME,)
            case "round":
                labels = tuple(map(str, self.args["poses"]))
                return (*labels, *labels)
            case "nowhere":
                return ()


@dataclass(frozen=True)
class Plan:
    """Numbered steps over labelled poses (x, y, z mm; rx, ry, rz rad; platform in base frame).

    ``purpose`` is ``measure``, ``verify``, ``check`` (of a write-back) or ``warming``.
    """

    purpose: str
    title: str
    machine: str
    poses: Mapping[str, Pose]
    steps: tuple[Step, ...]

    def to_json(self) -> str:
        """Render the plan as JSON text; a kind is written as its word."""
        steps = [{**vars(step), "kind": step.kind.name} for step in self.steps]
        return json.dumps({"format": FORMAT, **vars(self), "steps": steps}, indent=1)

    @staticmethod
    def from_json(text: str, source: str) -> "Plan":
        """Read a plan back; raises :class:`BadInput` if it is none, or has steps unknown here."""
        try:
            data = json.loads(text)
            if data["format"] != FORMAT:
                raise ValueError(f"format {data['format']!r}")
            return Plan(
                purpose=data["purpose"],
                title=data["title"],
                machine=data["machine"],
                poses={label: _pose(pose) for label, pose in data["poses"].items()},
                steps=tuple(_step(step, source) for step in data["steps"]),
            )
        except (ValueError, KeyError, TypeError) as error:
            raise BadInput(
                f"not a plan of this program ({error})", place=source, remedy="Measure anew"
            ) from error


class PlanWriter:
    """Collects steps and numbers them."""

    def __init__(self) -> None:
        self.steps: list[Step] = []

    def add(self, kind: StepKind, about: str = "", says: str = "", **args: Any) -> None:
        """Append a step; ``about`` goes into its identifier, ``says`` replaces its kind's words."""
        number = f"{len(self.steps) + 1:04d}"
        parts = [number, kind.name, about] if about else [number, kind.name]
        words = says or kind.words.format(**args)
        self.steps.append(Step("-".join(parts), kind, words, args))


def _step(stored: Mapping[str, Any], source: str) -> Step:
    step = Step(**{**stored, "kind": kind_named(stored["kind"], source)})
    _ = step.goal  # a step that moves to a pose says to which
    return step


def _pose(values: Any) -> Pose:
    x, y, z, rx, ry, rz = (float(value) for value in values)
    return x, y, z, rx, ry, rz
