"""Many machines of one type: each fitted alone, then with what all of them have in common."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.files.models import chosen_effects
from app.jobs.chosen_runs import File, Runs, path_of
from app.jobs.fleet_folders import places_of
from app.jobs.fleet_machine import Asked, Found, digest_of, fit_machine, keep, kept
from app.jobs.record import Record, Report
from app.spread import spread
from calib.analysis.population import FEWEST, Population, family_wise, misfits, population
from calib.arrays import Array
from calib.errors import BadInput

FAMILY = 0.05
"""Probability that a fleet without an outlier has a machine named."""
MISFIT = "misfit"
"""Named in place of a parameter where a machine's readings are explained worse than the others'."""


@dataclass(frozen=True, kw_only=True)
class FleetParameter(Record):
    """A parameter over the fleet: drawn with ``tolerance`` (1 sigma), found to have ``spread``."""

    name: str
    unit: str
    nominal: float
    tolerance: float
    mean: float
    spread: float


@dataclass(frozen=True, kw_only=True)
class FleetMachine(Record):
    """One machine; ``values`` and ``sigmas`` with the fleet's priors, in the order of parameters.

    ``alone`` are its values with the tolerances as priors. ``failed`` says why it has none.
    """

    name: str
    run: str
    failed: str
    readings: int
    excluded: int
    rms_um: float | None
    noise_floor_um: float | None
    holdout_rms_um: float | None
    chi2_per_dof: float | None
    outlier: bool
    values: tuple[float, ...]
    sigmas: tuple[float, ...]
    alone: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class FleetOutlier(Record):
    """Where a machine is not like the others: a parameter, or ``misfit``.

    ``ratio``: how far off, in standard deviations of what the others let expect (of misfit: of the
    logarithm of chi-square per degree of freedom); ``p_value`` over all machines and parameters.
    """

    machine: str
    what: str
    ratio: float
    p_value: float


@dataclass(frozen=True, kw_only=True)
class FleetReport(Report):
    """What a fleet is like (``pkm-fleet/1``)."""

    FORMAT: ClassVar[str] = "pkm-fleet/1"
    machine: str
    effects: tuple[str, ...]
    parameters: tuple[FleetParameter, ...]
    machines: tuple[FleetMachine, ...]
    outliers: tuple[FleetOutlier, ...]
    remarks: tuple[str, ...]


def fit_fleet(
    folders: Runs,
    *,
    add: Sequence[str] = (),
    out: File | None = None,
    workers: int | None = None,
    scheduler: str = "",
    watch: Callable[[int, int], None] | None = None,
) -> FleetReport:
    """Fit many machines of one type, and learn from all what is usual among them.

    Parameters
    ----------
    folders : path or sequence of paths
        Runs, one of each machine, or folders that hold such runs.
    add : sequence of str
        Effects in the model of every machine: names, or effect files that end in ``.toml``.
    out : path, optional
        Folder that keeps the answer of every machine: what is asked again is not computed again.
    workers : int, optional
        Processes; one for each processor if not given.
    scheduler : str, optional
        Address of a Dask scheduler in place of processes.
    watch : callable, optional
        Told how many machines of how many are done.

    Returns
    -------
    FleetReport
        The same whoever computed it, and in whatever order.

    Raises
    ------
    BadInput
        Where as many machines are of one type as of another, fewer than two can be fitted, or a
        scheduler does not answer. What cannot be read, or is of another type than most, is told.

    Examples
    --------
    >>> found = pkmcal.fit_fleet("antennas", out="results")                  # doctest: +SKIP
    >>> [(one.machine, one.what) for one in found.outliers]                  # doctest: +SKIP
    [('A17', 'leg3.L0')]
    """
    kept_in = path_of(out)
    places, empty = places_of(folders, kept_in)
    machine = next(one.run.machine for one in places if one.run is not None)
    effects = tuple(chosen_effects(machine, tuple(add), None))
    names = _called([one.folder for one in places])
    asked = [
        Asked(name, one.run, effects, digest_of(one.run, add))
        for name, one in zip(names, places, strict=True)
        if one.run is not None
    ]
    found = {one.name: one for one in _answers(asked, kept_in, workers, scheduler, watch)}
    told = [
        (one.folder, found.get(name, Found(name, failed=one.failed)))
        for name, one in zip(names, places, strict=True)
    ]
    said = _said(machine.name, told, [effect.id for effect in effects])
    said["remarks"] += [f"{folder}: no run lies in it" for folder in empty]
    return FleetReport.of(said)


def _called(folders: Sequence[Path]) -> list[str]:
    """Names of machines: their folders', with as much before them as tells them apart."""
    for depth in range(1, max(len(folder.parts) for folder in folders) + 1):
        names = ["-".join(folder.parts[-depth:]).strip("/") for folder in folders]
        if len(set(names)) == len(names):
            return names
    raise AssertionError("folders are distinct")


def _answers(
    asked: Sequence[Asked],
    out: Path | None,
    workers: int | None,
    scheduler: str,
    watch: Callable[[int, int], None] | None,
) -> list[Found]:
    """Every machine alone: from the folder of results, or from a worker."""
    found: dict[str, Found] = {}
    for one in asked if out is not None else ():
        assert out is not None
        known = kept(out, one.name, one.digest)
        if known is not None:
            found[one.name] = known
    left = [one for one in asked if one.name not in found]
    tell = watch or (lambda done, of: None)
    tell(len(found), len(asked))
    for number, answer in spread(fit_machine, left, workers=workers, scheduler=scheduler):
        found[answer.name] = answer
        if out is not None:
            keep(out, answer, left[number].digest)
        tell(len(found), len(asked))
    return [found[one.name] for one in asked]


def _said(
    machine: str, told: Sequence[tuple[Path, Found]], effects: Sequence[str]
) -> dict[str, Any]:
    """The answer as plain data, of machines and the folders of their runs."""
    found = [one for _, one in told]
    good = [one for one in found if not one.failed]
    if len(good) < 2:
        why = next(one.failed for one in found if one.failed)
        raise BadInput(f"fewer than two machines can be fitted: {why}", remedy="Correct their runs")
    shared = [name for name in good[0].names if all(name in one.names for one in good)]
    where = [[one.names.index(name) for name in shared] for one in good]
    first, at = good[0], where[0]
    looks = len(good) * (len(shared) + 1)
    worse = misfits(np.array([one.chi2 for one in good]), np.array([one.dof for one in good]))
    teach = np.array([family_wise(float(chance), looks) >= FAMILY for chance in worse[1]])
    fleet = population(
        np.array([one.values[own] for one, own in zip(good, where, strict=True)]),
        np.array([one.covariance[np.ix_(own, own)] for one, own in zip(good, where, strict=True)]),
        first.centre[at],
        first.prior[at],
        teach,
    )
    ratios = np.column_stack([fleet.ratio, worse[0]])
    # What is not explained by the model says nothing of its parameters.
    chances = np.column_stack([np.where(teach[:, None], fleet.chance, 1.0), worse[1]])
    outliers = _outliers(good, (*shared, MISFIT), ratios, chances)
    named = {one["machine"] for one in outliers}
    numbers = {one.name: number for number, one in enumerate(good)}
    return {
        "format": FleetReport.FORMAT,
        "machine": machine,
        "effects": effects,
        "parameters": [
            {
                "name": name, "unit": first.units[own], "nominal": first.centre[own],
                "tolerance": first.prior[own], "mean": fleet.mean[k], "spread": fleet.spread[k],
            }
            for k, (name, own) in enumerate(zip(shared, at, strict=True))
        ],
        "machines": [
            {
                "name": one.name, "run": str(folder), "failed": one.failed,
                "readings": one.readings, "excluded": one.excluded, "rms_um": one.rms_um,
                "noise_floor_um": one.noise_floor_um, "holdout_rms_um": one.holdout_rms_um,
                "chi2_per_dof": one.chi2 / one.dof if one.dof > 0 else None,
                "outlier": one.name in named,
                **_values(one, shared, fleet, numbers.get(one.name)),
            }
            for folder, one in told
        ],
        "outliers": outliers,
        "remarks": _remarks(found, good),
    }  # fmt: skip


def _values(
    one: Found, shared: Sequence[str], fleet: Population, number: int | None
) -> dict[str, Any]:
    if number is None:
        return {"values": [], "sigmas": [], "alone": []}
    return {
        "values": fleet.values[number],
        "sigmas": np.sqrt(np.diag(fleet.covariance[number])),
        "alone": [one.values[one.names.index(name)] for name in shared],
    }


def _outliers(
    good: Sequence[Found], whats: Sequence[str], ratios: Array, chances: Array
) -> list[dict[str, Any]]:
    """Machines that are not like the others, the surest first; ratios and chances (K, P + 1)."""
    listed = [
        {"machine": machine.name, "what": what, "ratio": float(ratio), "p_value": p}
        for machine, *numbers in zip(good, ratios, chances, strict=True)
        for what, ratio, chance in zip(whats, *numbers, strict=True)
        if (p := family_wise(float(chance), chances.size)) < FAMILY
    ]
    return sorted(listed, key=lambda entry: float(str(entry["p_value"])))


def _remarks(found: Sequence[Found], good: Sequence[Found]) -> list[str]:
    remarks = [f"{one.name} is left out: {one.failed}" for one in found if one.failed]
    if len(good) < FEWEST:
        remarks.append(f"With fewer than {FEWEST} machines none can be called an outlier.")
    return remarks
