"""A comparison of model and run as plain data (``pkm-compare/1``), in micrometres."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib.discover.compare import RunComparison
from calib.evidence.compare import Speaking
from calib.evidence.repeats import PureError
from calib.look.judged import record_of
from calib.runs.remark import Remark, plain_remarks


def compare_report(found: RunComparison) -> dict[str, Any]:
    """Repeatability first, then state variables, the one with the most structure first."""
    fit = found.fit
    record = record_of(fit)
    return {
        "format": "pkm-compare/1",
        "effects": [effect.id for effect in fit.model.effects],
        "readings": fit.readings,
        "rms_um": 1000.0 * fit.rms_mm,
        "noise_floor_um": 1000.0 * fit.noise_floor_mm,
        "chi2_per_dof": fit.chi2_per_dof,
        "repeatability": _repeatability(found.repeatability),
        "reference_repeatability": _repeatability(found.reference_repeatability),
        "structure": [
            _speaking(found, one, moved)
            for one, moved in zip(found.speaking, found.displacement_mm, strict=True)
        ],
        "together": [
            {"channel": one.channel, "p_value": one.p_value, "significant": one.significant}
            for one in found.together
        ],
        "actuators": _actuators(found),
        "worst_poses": _worst(found),
        "bad_readings": [{"line": bad.line, "why": bad.why} for bad in fit.bad],
        "record": plain_remarks(record),
        "advice": _advice(found, record),
    }


def factor_of(unit: str) -> tuple[float, str]:
    """Factor and unit of the report: um for mm, urad for rad."""
    return (1e6, "urad") if unit == "rad" else (1000.0, "um")


def acts_on(found: RunComparison, one: Speaking) -> str:
    """In which direction a dependence shows most, in words."""
    machine = found.fit.model.rows.machine
    if one.acts_on.startswith("leg"):
        index = one.axis if one.acts_on == "legs" else int(one.acts_on[3:]) - 1
        return f"extension of {machine.actuators[index].name}"
    return f"{'xyz'[one.axis]} of the {'nest' if one.acts_on == 'seat' else 'point'}"


def _speaking(found: RunComparison, one: Speaking, moved_mm: float) -> dict[str, Any]:
    factor, unit = factor_of(one.unit)
    return {
        "channel": one.channel,
        "p_value": one.p_value,
        "significant": one.significant,
        "explains_um": 1000.0 * moved_mm,
        "shows_in": acts_on(found, one),
        "period": one.period,
        "unit": unit,
        "bins": [
            {
                "from": each.low,
                "to": each.high,
                "readings": each.readings,
                "value": factor * each.value,
                "sigma": factor * each.sigma,
            }
            for each in one.bins
        ],
    }


def _repeatability(repeats: PureError) -> dict[str, Any] | None:
    if repeats.dof == 0:
        return None
    return {
        "dof": repeats.dof,
        "times_stated_sigma": float(np.sqrt(repeats.variance)),
        "p_value": repeats.p_value,
        "unrepeatable_part_of_misfit": repeats.excess,
    }


def _actuators(found: RunComparison) -> list[dict[str, Any]]:
    actuators = found.fit.model.rows.machine.actuators
    known = np.isfinite(found.poses.extension).all(axis=0)
    if not known.any():
        return []
    rms = np.sqrt(np.mean(found.poses.extension[:, known] ** 2, axis=1))
    return [
        {"actuator": a.name, "rms": factor_of(a.unit)[0] * float(r), "unit": factor_of(a.unit)[1]}
        for a, r in zip(actuators, rms, strict=True)
    ]


def _worst(found: RunComparison, count: int = 5) -> list[dict[str, Any]]:
    size = np.sqrt(np.sum(found.poses.shift**2, axis=0))
    return [
        {
            "pose": found.poses.names[index],
            "position": [float(value) for value in found.poses.position[:, index]],
            "shift_um": [1000.0 * float(value) for value in found.poses.shift[:, index]],
        }
        for index in np.argsort(-size)[:count]
    ]


def _advice(found: RunComparison, record: Sequence[Remark]) -> str:
    first = [one for one in record if not one.settled]
    if first:
        return f"{first[0].says}. {first[0].remedy}."
    loud = [one.channel for one in found.speaking if one.significant]
    repeats = found.repeatability
    if repeats.dof and repeats.p_value < 0.01 and repeats.excess > 0.5:
        return (
            "Most of the misfit does not repeat: no effect can explain it. Look for play, "
            "for SMRs that do not seat, for air turbulence."
        )
    if loud:
        return f"The residual depends on {', '.join(loud[:3])}: ask pkmcal diagnose which effect."
    if any(one.significant for one in found.together):
        return "Poses err as a whole, but on no single state variable: ask pkmcal diagnose."
    return "The residual looks like noise against everything that is known of the readings."
