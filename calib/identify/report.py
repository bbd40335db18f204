"""What a fit says: values, uncertainties, and what the data cannot tell, in words.

The answer is the JSON object ``pkm-fit/1``.
"""

import math
from typing import Any

import numpy as np

from calib.arrays import BoolArray
from calib.identify.by_kind import plain_kinds
from calib.identify.fitting import Fit
from calib.identify.holdout import hold_out

IDENTIFIED = 0.5
"""A parameter is identified when the data reduce its prior sigma to less than this part."""
TOGETHER = 0.5
"""Unidentified parameters whose errors correlate beyond this stand in one group."""


def fit_report(fit: Fit) -> dict[str, Any]:
    """Answer of ``pkmcal fit --json``."""
    held = hold_out(fit)
    return {
        "format": "pkm-fit/1",
        "effects": [effect.id for effect in fit.model.effects],
        "readings": fit.readings,
        **quality(fit),
        "holdout_rms_um": um(held.rms_mm),
        "holdout_floor_um": um(held.floor_mm),
        **of_platform(fit),
        "by_kind": plain_kinds(fit),
        "parameters": parameter_table(fit),
        "unidentified": unidentified_groups(fit),
        "unidentified_words": unidentified_words(fit),
        "bad_readings": bad_readings(fit),
        "left_out_readings": int(fit.model.lacking.sum()),
        "channels_left_aside": {
            name: why for run in fit.model.rows.runs for name, why in run.left_aside.items()
        },
    }


def quality(fit: Fit) -> dict[str, float | None]:
    """Chi-square per degree of freedom, RMS and noise floor."""
    return {
        "chi2_per_dof": _finite(fit.chi2_per_dof),
        "rms_um": um(fit.rms_mm),
        "noise_floor_um": um(fit.noise_floor_mm),
    }


def of_platform(fit: Fit) -> dict[str, float | None]:
    """RMS and floor of the fitted readings whose poses are held out in turn: like with like."""
    which = fit.accepted & (fit.model.rows.fold >= 0)
    return {
        "platform_rms_um": um(fit.rms_of(which)),
        "platform_floor_um": um(fit.floor_of(which)),
    }


def bad_readings(fit: Fit) -> list[dict[str, Any]]:
    """Excluded readings with their lines; the run is named where there are several."""
    several = len(fit.model.rows.runs) > 1
    return [
        {
            "line": reading.line,
            "why": reading.why,
            **({"run": fit.model.rows.runs[reading.run].source} if several else {}),
        }
        for reading in sorted(fit.bad, key=lambda reading: (reading.run, reading.line))
    ]


def parameter_table(fit: Fit) -> list[dict[str, Any]]:
    """Machine parameters, effects' unknowns and frames with their uncertainties."""
    model = fit.model
    identified = identified_mask(fit)
    units = [model.machine.parameters[index].unit for index in model.free]
    units += [unknown.unit for group in model.unknowns for unknown in group]
    units += [unknown.unit for unknown in model.setup.unknowns]
    units += ["mm", "mm", "mm", "rad", "rad", "rad"] * model.frames
    unknowns = {one.name: one for group in model.unknowns for one in group}
    nominal: list[float | None] = [float(v) for v in model.centre]
    nominal[len(nominal) - 6 * model.frames :] = [None] * (6 * model.frames)
    return [
        {
            "name": name,
            "value": float(value),
            "sigma": float(sigma),
            "unit": unit,
            "nominal": at,
            "identified": bool(known),
            **(unknowns[name].in_words(float(value)) if name in unknowns else {}),
        }
        for name, value, sigma, unit, at, known in zip(
            model.names, fit.values, fit.sigmas, units, nominal, identified, strict=True
        )
    ]


def identified_mask(fit: Fit) -> BoolArray:
    """Which unknowns (p,) the data determine; frames always."""
    return np.asarray(fit.sigmas < IDENTIFIED * fit.model.prior)


def unidentified_groups(fit: Fit) -> list[list[str]]:
    """Parameters that the data leave open, together where only a combination is open."""
    unknown = np.flatnonzero(~identified_mask(fit))
    sigma = fit.sigmas[unknown]
    correlation = fit.covariance[np.ix_(unknown, unknown)] / (sigma[:, None] * sigma)
    linked = np.abs(correlation) > TOGETHER
    left, groups = set(range(unknown.size)), []
    while left:
        group, edge = set(), {min(left)}
        while edge:
            group |= edge
            edge = {int(j) for i in edge for j in np.flatnonzero(linked[i])} - group
        left -= group
        groups.append([fit.model.names[unknown[index]] for index in sorted(group)])
    return groups


def unidentified_words(fit: Fit) -> list[str]:
    """One sentence for each group of :func:`unidentified_groups`."""
    return [
        f"{group[0]} is not seen by these readings; it stays near its drawing value"
        if len(group) == 1
        else f"{', '.join(group[:-1])} and {group[-1]} cannot be told apart by these readings; "
        "only a combination of them is known"
        for group in unidentified_groups(fit)
    ]


def um(millimetres: float) -> float | None:
    """Length in micrometres; None where it is not finite, for JSON."""
    return _finite(1000.0 * millimetres)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
