"""One machine of a fleet: what a worker is asked, what it answers, and the answer on the disk."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from app.analysis import looked_at
from app.files.runs import HEADER, POINTS, LoadedRun
from app.plain_data import plain
from calib.arrays import Array
from calib.effects import Effect
from calib.errors import BadInput
from calib.identify.holdout import hold_out
from calib.identify.report import um
from calib.identify.staged import fit_effects

STORED = "pkm-fleet-machine/1"


@dataclass(frozen=True, eq=False)
class Asked:
    """A machine: its name, its run, the effects in its model, and what tells it from others."""

    name: str
    run: LoadedRun
    effects: tuple[Effect, ...]
    digest: str


@dataclass(frozen=True, eq=False)
class Found:
    """A machine as it was fitted alone; ``failed`` says why it could not be.

    ``values`` (p,), ``covariance`` (p, p), ``centre`` and ``prior`` (p,) are of the unknowns with
    a prior that enter linearly: ``names`` in their ``units``.
    """

    name: str
    failed: str = ""
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    values: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    centre: Array = field(default_factory=lambda: np.zeros(0))
    prior: Array = field(default_factory=lambda: np.zeros(0))
    readings: int = 0
    excluded: int = 0
    chi2: float = 0.0
    dof: float = 0.0
    rms_um: float | None = None
    noise_floor_um: float | None = None
    holdout_rms_um: float | None = None


def fit_machine(asked: Asked) -> Found:
    """Fit one machine alone; what is wrong with its run is told, not raised."""
    try:
        rows, effects = looked_at([asked.run], asked.effects)
        fit = fit_effects(rows, effects)
    except BadInput as wrong:
        return Found(asked.name, failed=str(wrong))
    model = fit.model
    unknowns = [unknown for group in model.unknowns for unknown in group]
    count, machine = model.free.size, model.machine
    kept = np.array([True] * count + [not unknown.nonlinear for unknown in unknowns])
    units = [machine.parameters[index].unit for index in model.free]
    units += [unknown.unit for unknown in unknowns]
    which = np.flatnonzero(kept)
    return Found(
        asked.name,
        names=tuple(model.names[index] for index in which),
        units=tuple(units[index] for index in which),
        values=fit.values[which],
        covariance=fit.covariance[np.ix_(which, which)],
        centre=model.centre[which],
        prior=model.prior[which],
        readings=fit.readings,
        excluded=len(fit.bad),
        chi2=fit.chi2,
        dof=float(fit.dof),
        rms_um=um(fit.rms_mm),
        noise_floor_um=um(fit.noise_floor_mm),
        holdout_rms_um=um(hold_out(fit).rms_mm),
    )


def digest_of(run: LoadedRun, add: Sequence[str]) -> str:
    """What an answer hangs on: the run's files, its machine, the effects, this program."""
    told = hashlib.sha256(version("pkmcal").encode())
    for file in (HEADER, POINTS):
        told.update((run.folder / file).read_bytes())
    for parameter in run.machine.parameters:
        told.update(repr(parameter).encode())
    for name in add:
        told.update(Path(name).read_bytes() if name.endswith(".toml") else name.encode())
    return told.hexdigest()


def keep(folder: Path, found: Found, digest: str) -> None:
    """Write an answer, there as a whole or not at all."""
    said = {"format": STORED, "digest": digest, **plain(vars(found))}
    path = _file(folder, found.name)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".draft")
    draft.write_text(json.dumps(said), encoding="utf-8")
    draft.replace(path)


def kept(folder: Path, name: str, digest: str) -> Found | None:
    """The answer of an earlier call to the same question; None where there is none."""
    try:
        said: dict[str, Any] = dict(json.loads(_file(folder, name).read_text(encoding="utf-8")))
        if said.pop("format") != STORED or said.pop("digest") != digest:
            return None
        for key in ("values", "covariance", "centre", "prior"):
            said[key] = np.array(said[key], dtype=np.float64)
        told: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in said.items()}
        return Found(**told)
    except (OSError, ValueError, TypeError, KeyError):  # cut short, or not ours
        return None


def _file(folder: Path, name: str) -> Path:
    return folder / "machines" / f"{name}.json"
