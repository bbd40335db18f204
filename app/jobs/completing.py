"""Which errors a machine file lacks: found by rank, proposed in the file's own words."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import ClassVar

import numpy as np
import tomli_w

from app.files.chain_text import Error, chains_of, described, errors_of, filled, with_errors
from app.files.machines import load_machine, shipped_machines
from app.files.text import read_text
from app.jobs.record import Record, Report
from calib.analysis.lacking import Lacking, lacking
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward
from calib.poses.information import frame_columns
from calib.poses.reach import sample_poses

LEAST = 1e-4
"""RMS in mm below which an error is not worth a parameter."""
POSES = 60
SEED = 1
USUAL = {"mm": 0.1, "rad": 1e-3}
"""Tolerance of an error where the file has no parameter in that unit."""


@dataclass(frozen=True, kw_only=True)
class LackingEntry(Record):
    """An error that the file's parameters do not imitate.

    ``beyond_um``: RMS over the workspace by which an error of the usual size moves the platform
    and nothing else in the file can. ``tool``: it stands behind the last joint of a machine of one
    limb, so that it is the places of the nests on the flange; it counts where these are not known.
    """

    name: str
    limb: str
    element: str
    joint: int
    unit: str
    tolerance: float
    beyond_um: float
    tool: bool


@dataclass(frozen=True, kw_only=True)
class CompletionReport(Report):
    """What a machine file lacks (``pkm-completion/1``)."""

    FORMAT: ClassVar[str] = "pkm-completion/1"
    machine: str
    tried: int
    parameters: int
    rank_before: int
    rank_after: int
    lacking: tuple[LackingEntry, ...]
    proposal: str
    _text: str = field(repr=False, compare=False)

    @property
    def text(self) -> str:
        """The whole file with what it lacks, but for errors of the tool unless these were asked."""
        return self._text


def complete(machine: str | Path, *, tool: bool = False) -> CompletionReport:
    """Find the errors that no parameter of a machine file imitates.

    Six errors, tx to rz, are put at the base of every chain and behind every joint.

    Parameters
    ----------
    machine : str or path
        A shipped machine, or a machine file.
    tool : bool
        Propose errors behind the last joint of a machine of one limb as well.

    Returns
    -------
    CompletionReport

    Raises
    ------
    BadInput
        If the file cannot be used.

    Examples
    --------
    >>> pkmcal.complete("my-arm.toml").proposal                              # doctest: +SKIP
    """
    found = load_machine(str(machine))
    return completed(_text_of(str(machine)), found, _usual(found), tool=tool)


def completed(
    text: str, described_machine: Machine, usual: dict[str, float], *, tool: bool
) -> CompletionReport:
    """Complete the text of a machine file; ``usual`` tolerances by unit, mm and rad."""
    errors = errors_of(tomllib.loads(text))
    written = {unit: f"{value!r}" for unit, value in usual.items()}
    every = parse_machine(_bare(with_errors(text, errors, written, "")), described_machine.source)
    found = _found(described_machine, every, errors)
    one_limb = len({limb.name for limb in described_machine.limbs}) == 1
    chosen = [errors[k] for k in found.chosen]
    entries = [
        {
            "name": one.name,
            "limb": one.owner[1],
            "element": one.element,
            "joint": one.joint,
            "unit": one.unit,
            "tolerance": usual[one.unit],
            "beyond_um": 1000.0 * beyond,
            "tool": one_limb and one.last,
        }
        for one, beyond in zip(chosen, found.beyond, strict=True)
    ]
    taken = [one for one in chosen if tool or not (one_limb and one.last)]
    return CompletionReport.of(
        {
            "format": CompletionReport.FORMAT,
            "machine": described_machine.name,
            "tried": len(errors),
            "parameters": len(described_machine.parameters),
            "rank_before": found.rank_before,
            "rank_after": found.rank_after,
            "lacking": entries,
            "proposal": _proposal(text, taken, written),
        },
        _text=with_errors(text, taken, written, "error"),
    )


def _text_of(machine: str) -> str:
    if machine in shipped_machines():
        return (resources.files("calib.machines") / f"{machine}.toml").read_text(encoding="utf-8")
    return read_text(Path(machine))


def _bare(text: str) -> str:
    """A machine file without traits: what parts are does not hold with errors between them."""
    top = tomllib.loads(text)
    for kind in ("limb_types", "limbs"):
        for table in top.get(kind, {}).values():
            table.pop("traits", None)
    return tomli_w.dumps(top)


def _usual(machine: Machine) -> dict[str, float]:
    """Median tolerance of the file's parameters by unit."""
    found = {}
    for unit, usual in USUAL.items():
        own = [p.tolerance for p in machine.parameters if p.unit == unit]
        found[unit] = float(f"{np.median(own):.3g}") if own else usual
    return found


def _found(machine: Machine, every: Machine, errors: Sequence[Error]) -> Lacking:
    """Compare columns of the candidates with those of the file, over reachable poses, in mm."""
    poses = sample_poses(machine, POSES, np.random.default_rng(SEED))
    here = forward(every, poses.configuration.extension, every.nominal)
    if not here.converged.all():
        raise BadInput(
            "the machine does not close with errors put in",
            place=machine.source,
            remedy="pkmcal machine check says how far it closes as it stands",
        )
    twists = pose_jacobians(every, here).parameters * every.prior_sigma[:, None, None]
    twists[:, 3:] *= machine.size
    columns = twists.reshape(len(twists), -1)
    frame = frame_columns(here.poses)
    frame[:, 3:] *= machine.size
    known = columns[np.array([every.index(p.name) for p in machine.parameters], dtype=np.intp)]
    candidates = [columns[_members(every, one)] for one in errors]
    places = [one.element[0] == "t" for one in errors]
    return lacking(known, frame.reshape(6, -1), candidates, places, LEAST)


def _members(every: Machine, one: Error) -> Array:
    """Parameters that one error becomes: of its limb, or of each limb of its type."""
    owners = {limb.name for limb in every.limbs}
    names = [f"{owner}.{one.name}" for owner in owners]
    if one.owner[0] == "limbs":
        names = [f"{one.owner[1]}.{one.name}"]
    index = every.parameter_index
    return np.array(sorted(index[name] for name in names if name in index), dtype=np.intp)


def _proposal(text: str, errors: Sequence[Error], tolerance: dict[str, str]) -> str:
    """TOML to paste: chains with the errors in them, and their parameters."""
    parts = []
    for owner, chains in chains_of(tomllib.loads(text)).items():
        own = [one for one in errors if one.owner == owner]
        if not own:
            continue
        quoted = [
            f'"""{filled(chain, [one for one in own if one.chain == k])}"""'
            for k, chain in enumerate(chains)
        ]
        words = f"chain = {quoted[0]}" if len(quoted) == 1 else f"chains = [{', '.join(quoted)}]"
        lines = [described(one, tolerance, "error") for one in own]
        head = f"{owner[0]}.{owner[1]}"
        parts.append("\n".join([f"[{head}]", words, f"[{head}.parameters]", *lines]))
    return "\n\n".join(parts)
