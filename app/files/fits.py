"""What a fit found, read back for the write-back: a model file, or the JSON answer of ``fit``.

``pkmcal fit --save FILE`` writes TOML (``pkm-model/1``) with correlations; ``pkmcal fit --json``
answers JSON (``pkm-fit/1``) without them.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.files.text import read_text
from calib.errors import BadInput
from calib.toml_place import load_toml
from calib.unknown import Estimate, Unknown

Array = NDArray[np.float64]


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

    def covariance_of(self, names: list[str]) -> Array:
        """Covariance of some parameters, in that order."""
        order = list(self.estimates)
        chosen = [order.index(name) for name in names]
        part: Array = self.covariance[np.ix_(chosen, chosen)]
        return part


def read_fit(path: Path) -> SavedFit:
    """Read a saved fit; raises :class:`BadInput` naming the file and what is wrong with it."""
    text = read_text(path)
    source = str(path)
    data = _json(text, source) if text.lstrip().startswith("{") else load_toml(text, source)
    if data.get("format") not in ("pkm-model/1", "pkm-fit/1"):
        raise BadInput(
            f"format is {data.get('format')!r}",
            place=source,
            remedy="Give the file that pkmcal fit --save wrote",
        )
    try:
        estimates = {entry["name"]: _estimate(entry) for entry in data["parameters"]}
        quality = {**data.get("quality", {}), **data}
        quality = {k: float(v) for k, v in quality.items() if isinstance(v, int | float)}
        effects = tuple(str(effect) for effect in data.get("effects", []))
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(
            f"its parameters cannot be read ({error})", place=source, remedy="Fit again"
        ) from error
    if not estimates:
        raise BadInput("it holds no parameters", place=source, remedy="Fit again with --save")
    covariance, correlated = _covariance(estimates, data.get("correlations"), source)
    machine = str(data.get("machine", ""))
    return SavedFit(
        source,
        machine,
        effects,
        estimates,
        quality,
        covariance,
        correlated,
        _compensation(data.get("compensation"), source),
    )


def _compensation(table: Any, source: str) -> dict[str, float] | None:
    if table is None:
        return None
    try:
        return {str(name): float(value) for name, value in table.items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise BadInput(
            f"its compensation cannot be read ({error})", place=source, remedy="Fit again"
        ) from error


def _json(text: str, source: str) -> dict[str, Any]:
    try:
        data: dict[str, Any] = json.loads(text)
    except ValueError as error:
        raise BadInput(f"not JSON: {error}", place=source) from error
    return data


def _estimate(entry: Mapping[str, Any]) -> Estimate:
    value, sigma = entry["value"], entry["sigma"]
    return Estimate(
        Unknown(str(entry["name"]), str(entry.get("unit", ""))),
        math.nan if value is None else float(value),
        math.nan if sigma is None else float(sigma),
        bool(entry.get("identified", True)),
    )


def _covariance(
    estimates: Mapping[str, Estimate], correlations: Any, source: str
) -> tuple[Array, bool]:
    sigma = np.array([estimate.sigma for estimate in estimates.values()])
    correlation = np.eye(sigma.size)
    if correlations is not None:
        try:
            for i, name in enumerate(estimates):
                row = np.array(correlations[name], float)
                correlation[i, : i + 1] = row
                correlation[: i + 1, i] = row
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput(
                f"its correlations cannot be read ({error})", place=source, remedy="Fit again"
            ) from error
    return correlation * sigma[:, None] * sigma, correlations is not None
