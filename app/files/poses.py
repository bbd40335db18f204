"""Poses files: which poses to measure, in which order, and what is predicted.

The format is described in docs/poses-file.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.files.pose_table import HOME, Pose, read_poses
from app.files.text import read_text
from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.limits import violations
from calib.poses.design import Design
from calib.poses.reach import PoseSet, solve_poses
from calib.toml_faults import Faults
from calib.toml_table import TomlTable

FORMAT = "pkm-poses/1"
Q_AGREES = 0.01
"""How far a q written in the file may be from the nominal machine's, mm or rad."""


@dataclass(frozen=True, eq=False)
class PoseFile:
    """A poses file, checked: every pose is within reach of the nominal machine."""

    source: str
    title: str
    labels: tuple[str, ...]
    pose_set: PoseSet
    design: Mapping[str, Any]
    pairs: tuple[tuple[str, str], ...] = ()
    """Poses between whose marks calipers measure."""

    @property
    def by_label(self) -> dict[str, Pose]:
        """Label -> x, y, z (mm), rx, ry, rz (rad) of the platform in the base frame, in order."""
        return full_poses(self.labels, self.pose_set)


def full_poses(labels: tuple[str, ...], pose_set: PoseSet) -> dict[str, Pose]:
    """Label -> the six coordinates of the pose, in order."""
    poses: dict[str, Pose] = {}
    for label, column in zip(labels, pose_set.poses.to_xyz_rpy().T, strict=True):
        x, y, z, rx, ry, rz = (float(value) for value in column)
        poses[label] = (x, y, z, rx, ry, rz)
    return poses


def read_pose_file(path: Path, machine: Machine) -> PoseFile:
    """Read a poses file for a machine.

    Raises
    ------
    BadInput
        Naming file and line: not this format, another machine, a coordinate that is missing,
        unknown or not a number, a pose out of reach.
    """
    return parse_pose_file(read_text(path), str(path), machine)


def read_any_poses(path: Path, machine: Machine) -> dict[str, Pose]:
    """Label -> pose from a poses file, or from a bare table that ends in ``.csv``."""
    if path.suffix.lower() == ".csv":
        return read_poses(path)
    return read_pose_file(path, machine).by_label


def parse_pose_file(text: str, source: str, machine: Machine) -> PoseFile:
    """Check the text of a poses file."""
    return pose_file_of(TomlTable.parse(text, source, all_faults=True), source, machine)


def pose_file_of(top: TomlTable, source: str, machine: Machine) -> PoseFile:
    """Check the tables of a poses file."""
    faults = top.faults or Faults(source)
    top.format(FORMAT)
    name = top.text("machine", machine.name)
    if name != machine.name:
        raise top.wrong(
            f'these poses are for "{name}", the machine is "{machine.name}"',
            "machine",
            remedy="Choose poses for this machine: pkmcal poses",
        )
    title = top.text("title", "")
    notes = top.named("design", required=False)
    design = {key: notes.raw(key) for key in notes}
    poses, pairs = top.named("poses"), top.texts("pairs")
    top.end()
    labels = tuple(poses.names())
    if not labels:
        raise top.wrong(
            "there is no pose", "poses", remedy='Write p01 = { x = 1.0, ..., rx = "2 deg" }'
        )
    if HOME in labels:
        poses.complain(f'no pose can be called "{HOME}"', HOME, remedy="Rename it")
    task = np.array([_coordinates(poses, label, machine) for label in labels]).T
    faults.end()  # what stands in for a faulty coordinate is out of reach, or anywhere
    pose_set = solve_poses(machine, task)
    _check_reach(pose_set, labels, poses)
    _check_q(pose_set, labels, poses)
    marks = _pairs(top, pairs, labels)
    faults.end()
    return PoseFile(source, title, labels, pose_set, design, marks)


def _pairs(
    top: TomlTable, texts: Sequence[str], labels: tuple[str, ...]
) -> tuple[tuple[str, str], ...]:
    """Pairs of labels, each ``"A:B"``."""
    found = []
    for text in texts:
        one, _, two = text.partition(":")
        if one not in labels or two not in labels or one == two:
            top.complain(
                f'"{text}" is no pair of poses', "pairs", remedy='Write pairs = ["p01:p07"]'
            )
        found.append((one, two))
    return tuple(found)


def read_marks(path: Path, machine: Machine) -> tuple[tuple[str, str], ...]:
    """The pairs of marks of a poses file; none of a bare table."""
    if path.suffix.lower() == ".csv":
        return ()
    return read_pose_file(path, machine).pairs


def _coordinates(poses: TomlTable, label: str, machine: Machine) -> list[float]:
    pose, names = poses.table(label), machine.task.coordinates
    pose.only(*names, "q")
    return [pose.quantity(name, "mm" if name in "xyz" else "rad") for name in names]


def _check_reach(pose_set: PoseSet, labels: tuple[str, ...], poses: TomlTable) -> None:
    for seen in violations(pose_set.machine, pose_set.configuration):
        label = labels[seen.pose]
        where = (
            f"{seen.what} would be {seen.value:.3f} {seen.unit}, its limits are {seen.low:g} to "
            f"{seen.high:g}"
            if seen.unit
            else seen.what
        )
        poses.complain(
            f'pose "{label}" is out of reach: {where}',
            label,
            remedy="Leave it out, or move it inward",
        )


def _check_q(pose_set: PoseSet, labels: tuple[str, ...], poses: TomlTable) -> None:
    """Refuse poses whose q were computed for another machine; q is there for people to read."""
    for k, label in enumerate(labels):
        pose, own = poses.table(label), pose_set.q[:, k]
        given = np.array(pose.quantities("q", len(own), "", tuple(own)))
        if np.max(np.abs(given - own)) > Q_AGREES:
            poses.complain(
                f'q of pose "{label}" is not what the machine file gives '
                f"({given[0]:g} against {own[0]:.4f}, ...)",
                label,
                remedy="Choose the poses anew, or remove q: the controller computes it",
            )


def render_pose_file(
    labels: tuple[str, ...],
    pose_set: PoseSet,
    title: str,
    design: Mapping[str, Any],
    comment: str,
    pairs: Sequence[str] = (),
) -> str:
    """Text of a poses file; coordinates are written to 0.001 mm and 0.001 deg."""
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [f'format = "{FORMAT}"', f'machine = "{pose_set.machine.name}"', f'title = "{title}"']
    if pairs:
        lines += ["", "# Marks left at these poses, between which calipers measure."]
        lines += [f"pairs = [{', '.join(_toml(pair) for pair in pairs)}]"]
    lines += ["", "[design]"] if design else []
    lines += [f"{key} = {_toml(value)}" for key, value in design.items()]
    lines += ["", "# Platform in the base frame, mm; q is what the nominal machine makes of it."]
    lines += ["[poses]"]
    names, decimals = pose_set.machine.task.coordinates, _decimals(pose_set)
    for label, task, q in zip(labels, pose_set.task.T, pose_set.q.T, strict=True):
        cells = [_cell(name, value) for name, value in zip(names, task, strict=True)]
        numbers = ", ".join(f"{value:.{decimals}f}" for value in q)
        lines.append(f"{label} = {{ {', '.join(cells)}, q = [{numbers}] }}")
    return "\n".join(lines) + "\n"


def render_design(design: Design, seed: int, comment: str, pairs: Sequence[str] = ()) -> str:
    """Text of the poses file of a design."""
    about = {
        "criterion": design.criterion,
        "readings": design.readings,
        "tolerances_as_priors": design.priors,
        "candidates": design.candidates,
        "seed": seed,
        "predicted_position_rms_um": round(design.accuracy.position_um, 2),
        "predicted_orientation_rms_mdeg": round(design.accuracy.orientation_mdeg, 3),
        "random_poses_position_rms_um": round(design.random.position_um, 2),
        "path_in_strokes": round(design.length, 2),
    }
    title = f"{len(design.labels)} poses for {design.machine.name}"
    return render_pose_file(design.labels, design.pose_set, title, about, comment, pairs)


def _decimals(pose_set: PoseSet) -> int:
    return 4 if all(a.unit == "mm" for a in pose_set.machine.actuators) else 6


def _cell(name: str, value: float) -> str:
    if name in "xyz":
        return f"{name} = {value:8.3f}"
    return f'{name} = "{float(np.rad2deg(value)):7.3f} deg"'


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else f"{value}"


def nest_matrix(nests: Mapping[str, Any]) -> Array:
    """Nest centres by name -> (3, M), mm."""
    return np.array([list(centre) for centre in nests.values()], dtype=float).reshape(-1, 3).T
