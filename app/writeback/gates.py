"""Sanity gates: what must be true before anything is written, and before it is kept.

Each gate is a number against a limit; limits can be changed by name, knowingly.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.defaults import LIMITS
from app.errors import GateRefused
from app.files.controller_frames import frames_apart
from app.files.fits import SavedFit
from app.hosted.command import AT_REFERENCE, BETWEEN_S
from app.session.events import GateChecked
from app.writeback.proposal import Proposal
from calib.arrays import Array
from calib.command import History, Identified, Surroundings, commands_for, standpoint
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import violations
from calib.mechanism.rigid import Poses, pose_difference
from calib.mechanism.solve import Configuration, forward, inverse
from calib.pose_error import Summary
from calib.poses import verification_poses


@dataclass(frozen=True)
class Gates:
    """The gates with this site's limits."""

    limits: Mapping[str, float]

    @staticmethod
    def with_limits(changed: Mapping[str, float]) -> "Gates":
        """Change some limits; raises :class:`BadInput` for a gate that does not exist."""
        for name in changed:
            if name not in LIMITS:
                raise BadInput(f'no gate "{name}"', remedy=f"Gates: {', '.join(LIMITS)}")
        return Gates({**LIMITS, **changed})

    def check(self, gate: str, value: float, unit: str, says: str) -> GateChecked:
        """Judge one value; what is not a number never passes."""
        limit = self.limits[gate]
        words = f"{gate}: {says}: {value:.4g} {unit}".rstrip() + f" (at most {limit:.4g})"
        return GateChecked(gate, value <= limit, value, limit, unit, words)


def refuse_if_any(checked: list[GateChecked], remedy: str) -> None:
    """Raise :class:`GateRefused` naming every gate that did not pass."""
    failed = [gate for gate in checked if not gate.passed]
    if failed:
        raise GateRefused(
            "; ".join(gate.says for gate in failed),
            remedy=remedy,
            gates=tuple(gate.gate for gate in failed),
        )


@dataclass(frozen=True)
class HostedSets:
    """Where the host computes the motion: the machine by the set in use and by the new one."""

    old: Identified
    new: Identified


def gates_of_proposal(
    gates: Gates,
    machine: Machine,
    fit: SavedFit,
    proposal: Proposal,
    held: Mapping[str, float],
    hosted: HostedSets | None = None,
    serial: str = "",
    frame: Mapping[str, str] | None = None,
) -> list[GateChecked]:
    """Everything that can be judged before the controller with this serial number is touched.

    ``frame`` is what its poses refer to now, in its own words, where it takes poses.
    """
    new_values = proposal.values
    odd = [name for name, value in new_values.items() if not math.isfinite(value)]
    odd += [c.name for c in proposal.changes if not math.isfinite(c.sigma) or c.sigma < 0.0]
    checked = [_of_this_machine(gates, fit, serial)]
    if fit.controller_frame and frame:
        checked.append(_in_this_frame(gates, fit, frame))
    checked.append(gates.check("finite", len(odd), "", "values that are not finite numbers"))
    if odd:
        return checked
    far = {
        p.name: abs(new_values[p.name] - p.nominal) / p.sigma
        for p in machine.parameters
        if p.sigma > 0.0
    }
    worst = max(far, key=far.__getitem__)
    says = f"farthest from its drawing value, in sigmas of the tolerance ({worst})"
    checked.append(gates.check("tolerance", far[worst], "", says))
    quality = fit.quality
    chi2 = quality.get("chi2_per_dof", math.nan)
    checked.append(gates.check("chi2", chi2, "", "chi-square per degree of freedom of the fit"))
    ratio = quality.get("holdout_rms_um", math.nan) / quality.get("holdout_floor_um", math.nan)
    says = "RMS of poses that the fit had not seen, over that of a perfect model"
    checked.append(gates.check("holdout", ratio, "", says))
    old = machine.vector({p.name: held[p.name] for p in machine.parameters})
    new = machine.vector({p.name: new_values[p.name] for p in machine.parameters})
    return checked + _over_workspace(gates, machine, fit, old, new, hosted)


def _in_this_frame(gates: Gates, fit: SavedFit, frame: Mapping[str, str]) -> GateChecked:
    """Whether the controller's poses mean what they meant while the runs were taken."""
    apart = frames_apart(fit.controller_frame, frame)
    says = "its poses refer to what they did when it was measured"
    if apart:
        says = f"{'; '.join(apart)}: set it as it was, at the controller and in the site file"
    return gates.check("frame", len(apart), "", says)


def _of_this_machine(gates: Gates, fit: SavedFit, serial: str) -> GateChecked:
    """Whether the runs were taken on another machine of the type; silence is no objection."""
    known = bool(fit.controller_serial and serial)
    other = known and fit.controller_serial != serial
    says = (
        f"the fit is of the controller with serial {fit.controller_serial}, {serial} answers"
        if other
        else f"serial {serial} answers, as when it was measured"
        if known
        else "serial numbers are not known; other machines"
    )
    return gates.check("machine", float(other), "", says)


def _over_workspace(
    gates: Gates,
    machine: Machine,
    fit: SavedFit,
    old: Array,
    new: Array,
    hosted: HostedSets | None,
) -> list[GateChecked]:
    """Limits, condition and predicted accuracy over the verification grid."""
    poses = verification_poses(machine).poses
    with_old = inverse(machine, poses, old)
    with_new = inverse(machine, poses, new)
    outside = 0
    for closed, held in ((with_old, old), (with_new, new)):
        # Coordinates of a host refer to the drawing, those of a controller to what it holds.
        reference = {} if hosted else _named(machine, held)
        outside += len({v.pose for v in violations(machine, closed, reference)})
    says = f"of {poses.count} poses outside a limit, with the old or the new parameters"
    checked = [gates.check("workspace", outside, "", says)]
    if outside:
        return checked
    worse = float(with_old.conditioning.min() / with_new.conditioning.min())
    says = "how much nearer to a singularity the new parameters are"
    checked.append(gates.check("condition", worse, "", says))
    spread = _uncertainty_um(machine, fit, with_new, new)
    says = "predicted RMS position error with the new parameters"
    checked.append(gates.check("uncertainty", spread, "um", says))
    # What the new model says of poses commanded with the old parameters.
    went = (
        forward(machine, with_old.extension, new, with_new).poses
        if hosted is None
        else _went_by_host(hosted, poses)
    )
    off = pose_difference(poses, went)[:3]
    before = 1e3 * float(np.sqrt(np.mean(np.sum(off * off, axis=0))))
    says = f"predicted error after over before ({before:.1f} um)"
    checked.append(gates.check("gain", spread / max(before, 1e-9), "", says))
    return checked


def _went_by_host(hosted: HostedSets, poses: Poses) -> Poses:
    """Where the new model puts poses, one after the other, that the host commands by the old.

    Effects are taken at their references; those that depend on anything else are left out.
    """
    identified = [_at_reference(one) for one in (hosted.old, hosted.new)]
    around = Surroundings(AT_REFERENCE, BETWEEN_S * np.arange(poses.count, dtype=np.float64))
    commands = commands_for(identified[0], poses, around)
    home = History.at_home(identified[1].machine)
    return standpoint(identified[1], commands.extension, around, home).poses


def _at_reference(identified: Identified) -> Identified:
    kept = [found for found in identified.effects if set(found.needs) <= set(AT_REFERENCE)]
    return replace(identified, effects=tuple(kept))


def _named(machine: Machine, vector: Array) -> dict[str, float]:
    return {p.name: float(v) for p, v in zip(machine.parameters, vector, strict=True)}


def _uncertainty_um(machine: Machine, fit: SavedFit, closed: Configuration, new: Array) -> float:
    """RMS position error over the poses that the fit's covariance predicts: tr(J C J^T)."""
    jacobian = np.asarray(pose_jacobians(machine, closed, new).parameters, float)[:, :3]
    covariance = fit.covariance_of([p.name for p in machine.parameters])
    flat = jacobian.reshape(jacobian.shape[0], -1)
    total = float(np.sum(flat * (covariance @ flat)))
    return 1e3 * math.sqrt(max(total, 0.0) / closed.count)


def gates_of_check(
    gates: Gates, before: Summary, after: Summary, noise_peak_um: float
) -> list[GateChecked]:
    """What must be true of poses measured with the new parameters, before they are kept."""
    peak = max(after.position_peak_um - noise_peak_um, 0.0)
    says = "peak position error at the check poses beyond the tracker's noise"
    checked = [gates.check("check-peak", peak, "um", says)]
    allowed = max(before.position_rms_um, noise_peak_um)
    says = (
        f"RMS error at the check poses after ({after.position_rms_um:.1f} um) over "
        f"before ({before.position_rms_um:.1f} um)"
    )
    checked.append(gates.check("check-rms", after.position_rms_um / allowed, "", says))
    return checked
