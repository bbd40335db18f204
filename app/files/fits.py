"""Model files: what a fit found, read back by every verb that takes one.

``pkmcal fit --save FILE`` writes TOML (``pkm-model/1``, described in docs/model-file.md) with
correlations; ``pkmcal fit --json`` answers JSON (``pkm-fit/1``) without them. Either is read.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from app.files.noises import SavedNoise, read_noise
from app.files.staircase import Way, read_way
from app.files.text import read_text
from calib.arrays import Array
from calib.command.region import Region
from calib.errors import BadInput
from calib.runs.header import Load, load_of, texts_of
from calib.toml_table import TomlTable
from calib.unknown import Estimate, Unknown

MODEL_FORMAT = "pkm-model/1"
FIT_FORMAT = "pkm-fit/1"
ROUNDED = 1e-6
"""By how much a correlation may exceed 1 because its digits were cut."""


@dataclass(frozen=True, eq=False)
class SavedFit:
    """A fit from a file.

    ``quality`` holds the numbers of the fit (``chi2_per_dof``, ``holdout_rms_um``, ...);
    ``covariance`` (p, p) is in the order of ``estimates``, diagonal where the file has no
    correlations (``correlated`` False).
    """

    source: str
    machine: str
    effects: tuple[str, ...]
    estimates: Mapping[str, Estimate]
    quality: Mapping[str, float]
    covariance: Array
    correlated: bool
    compensation: Mapping[str, float] | None = None
    """What the controller compensated while the runs were taken; None if the file is silent."""
    own: Mapping[str, str] = field(default_factory=dict)
    """Texts of the operator's own effects by their id: with them the file is complete."""
    machine_file: str = ""
    """A lab's own machine file, from the folder of this one; empty for a shipped machine."""
    controller_serial: str = ""
    """Serial number of the controller on which all runs were taken; empty if it is not known."""
    controller_frame: Mapping[str, str] = field(default_factory=dict)
    """What a closed controller's poses referred to in the runs, in its own words."""
    controller: Mapping[str, float] = field(default_factory=dict)
    """The controller's own parameters in the last run; nominal where they are missing."""
    load: Load | None = None
    """What the machine carried in the last run."""
    region: Region | None = None
    """Where it was measured; None if the file is silent."""
    runs: tuple[str, ...] = ()
    """Points files of the runs."""
    way: Way = field(default_factory=Way)
    """How it was found, where that was kept."""
    noise: SavedNoise | None = None
    """With what noise it counted; None where the readings were taken as they state."""

    def covariance_of(self, names: list[str]) -> Array:
        """Covariance of some parameters, in that order."""
        order = list(self.estimates)
        chosen = [order.index(name) for name in names]
        part: Array = self.covariance[np.ix_(chosen, chosen)]
        return part


def read_fit(path: Path) -> SavedFit:
    """Read a saved fit; raises :class:`BadInput` naming file, line and what is wrong with it."""
    return parse_fit(read_text(path), str(path))


def parse_fit(text: str, source: str) -> SavedFit:
    """Check the text of a saved fit, TOML or JSON."""
    if text.lstrip().startswith("{"):
        return fit_of(TomlTable(_json(text, source), text, source), source)
    return fit_of(TomlTable.parse(text, source), source)


def fit_of(top: TomlTable, source: str) -> SavedFit:
    """Check the tables of a saved fit; keys that are not asked for are left alone."""
    top.format(MODEL_FORMAT, FIT_FORMAT)
    estimates: dict[str, Estimate] = {}
    for entry in top.tables("parameters"):
        found = _estimate(entry)
        if found.name in estimates:
            raise entry.wrong(f'"{found.name}" is there twice', "name", remedy="Fit again")
        estimates[found.name] = found
    correlation = _correlation(top, list(estimates))
    sigma = np.array([estimate.sigma for estimate in estimates.values()], dtype=float)
    own = top.named("own_effects", required=False)
    return SavedFit(
        source=source,
        machine=top.text("machine", ""),
        effects=tuple(top.texts("effects")),
        estimates=estimates,
        quality={**top.named("quality", required=False).numbers_here(), **top.numbers_here()},
        covariance=correlation * sigma[:, None] * sigma,
        correlated=top.has("correlations"),
        compensation=top.numbers_by_name("compensation") if top.has("compensation") else None,
        own={name: own.text(name) for name in own},
        machine_file=top.text("machine_file", ""),
        controller_serial=top.text("controller_serial", ""),
        controller_frame=texts_of(top.named("controller_frame", required=False)),
        controller=top.numbers_by_name("controller"),
        load=load_of(top.table("load", required=False)) if top.has("load") else None,
        region=_region(top.table("measured")) if top.has("measured") else None,
        runs=tuple(top.texts("runs")),
        way=read_way(top),
        noise=read_noise(top),
    )


def _region(table: TomlTable) -> Region:
    """Ranges in which the machine was measured."""

    def ranges(key: str) -> dict[str, tuple[float, float]]:
        named = table.named(key, required=False)
        found = {}
        for name in named:
            low, high = named.numbers(name, 2)
            if low > high:
                raise named.wrong(f"{name} ends below its start", name, remedy="Fit again")
            found[name] = (low, high)
        return found

    return Region(table.whole("poses", 0), ranges("task"), ranges("actuators"), ranges("channels"))


def region_table(region: Region) -> dict[str, Any]:
    """The same to be written."""
    return {
        "poses": region.poses,
        "task": {name: list(ends) for name, ends in region.task.items()},
        "actuators": {name: list(ends) for name, ends in region.actuators.items()},
        "channels": {name: list(ends) for name, ends in region.channels.items()},
    }


def _json(text: str, source: str) -> dict[str, Any]:
    """The object of a JSON text; ``null`` says the same as a key that is left out."""
    try:
        data = json.loads(text, object_pairs_hook=_without_nulls)
    except (ValueError, RecursionError) as error:
        line = getattr(error, "lineno", 1)
        raise BadInput(
            f"not JSON: {error}", place=f"{source}, line {line}", remedy="Fit again"
        ) from error
    assert isinstance(data, dict), "the text begins with a brace"
    return data


def _without_nulls(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    return {name: value for name, value in pairs if value is not None}


def _estimate(entry: TomlTable) -> Estimate:
    value = entry.optional_number("value", finite=False)
    sigma = entry.optional_number("sigma", finite=False)
    return Estimate(
        Unknown(entry.text("name"), entry.text("unit", "")),
        math.nan if value is None else value,
        math.nan if sigma is None else sigma,
        entry.flag("identified", True),
    )


def _correlation(top: TomlTable, names: list[str]) -> Array:
    """Correlations (p, p) from the rows of their lower triangle; the unit matrix without them."""
    correlation = np.eye(len(names))
    if not top.has("correlations"):
        return correlation
    rows = top.named("correlations")
    for i, name in enumerate(names):
        row = np.array(rows.numbers(name, i + 1, most=1.0 + ROUNDED, finite=False), dtype=float)
        correlation[i, : i + 1] = row
        correlation[: i + 1, i] = row
    return correlation
