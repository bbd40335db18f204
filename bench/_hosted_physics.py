"""Where a mock on the wire stood, by its own physics at what was commanded: what the wire adds.

Of all sessions of a station the commands are taken in their order, as the journals have them; the
physics without wires (``mocks.simulate``) says where each of them leads. What is left to the truth
that the live mock told is settling, rounding of counts, times at which temperatures were read,
and whatever a driver does beside what it was told.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from app.session.folder import read_folder
from app.session.journal import Journal
from app.session.within import JOURNAL
from calib.arrays import Array
from mocks.hidden.table import Hidden
from mocks.physics.bodies import body_named
from mocks.simulate.machine import true_poses
from mocks.simulate.plan import RunPlan

TOLD = ("structure_temp_C", "payload_kg")


@dataclass
class _Moves:
    """Commands one after the other: q, what was told while they stood, and the truth (or None)."""

    q: list[tuple[float, ...]] = field(default_factory=list)
    told: list[dict[str, float]] = field(default_factory=list)
    truth: list[list[float] | None] = field(default_factory=list)

    def take(self, folder: Path) -> None:
        """Append those of a session."""
        journal = Journal(folder / JOURNAL, read_only=True)
        try:
            done, plan = journal.states(), read_folder(folder)[1]
            at = {
                step.args["pose"]: done[step.id].result["position"]
                for step in plan.steps
                if step.kind.name == "truth" and done[step.id].state == "done"
            }
            for row in journal.rows():
                if row.kind == "move":
                    self.q.append(row.q)
                    self.told.append({})
                    self.truth.append(at.get(row.pose))
                elif self.told:
                    known = {n: v for n, v in row.channels.items() if n in TOLD}
                    self.told[-1] = {**known, **self.told[-1]}
        finally:
            journal.close()


def added_by_the_wire(sessions: Path, truth: dict[str, Any]) -> Array:
    """Distances (N,) in um from the physics to where the mock stood, of every truth in sessions.

    ``truth``: the mock's answer to ``{"do": "truth"}``.
    """
    moves = _Moves()
    for folder in sorted(path for path in sessions.iterdir() if path.is_dir()):
        moves.take(folder)
    body = body_named("hexapod")
    home = np.array([actuator.home for actuator in body.machine.actuators])
    count, told = len(moves.q), dict.fromkeys(TOLD, 0.0)
    channels = {"delay_s": np.full(count, 100.0), "air_temp_C": np.full(count, 20.0)}
    channels |= {name: np.empty(count) for name in TOLD}
    for row, own in reversed(list(enumerate(moves.told))):
        told |= own  # a place where nothing was read has what was told next
        for name in TOLD:
            channels[name][row] = told[name]
    stood = true_poses(
        body, truth["parameters"], RunPlan(hidden=Hidden(truth["hidden"])), body.around.load,
        np.array(moves.q) - home, 30.0 * np.arange(count), channels,
    )  # fmt: skip
    seen = [(row, place) for row, place in enumerate(moves.truth) if place is not None]
    off = [np.array(place) - stood.position[row] for row, place in seen]
    return np.asarray(1e3 * np.linalg.norm(off, axis=1))
