"""Machines drawn within their tolerances: how far off they are, and what calibrating them leaves.

Nothing is linearised in the answer: every machine is closed exactly at every pose. A calibration
takes Gauss-Newton steps by the derivatives of the nominal machine, whose normal matrix all share
(over the tolerances derivatives change by about a hundredth: each step leaves that part of what
was left), until what is left is far below the uncertainty. What is drawn is drawn by a seed of
each machine: it is the same whatever machines are asked for beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.analysis.observation import Observation, Sights, observe
from calib.arrays import Array, BoolArray
from calib.mechanism.rigid import Poses, exponential, pose_difference, product, rotate
from calib.mechanism.solve import forward
from calib.poses.reach import PoseSet

STEPS = 5
TOGETHER = 20_000
"""Poses, of all machines, that are closed at once."""

Seed = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Errors:
    """Pose errors of D machines over some poses; nan where one does not close at each of them.

    RMS of the position in mm and of the orientation in rad, and the largest of the position, (D,).
    """

    position: Array
    orientation: Array
    largest: Array

    @classmethod
    def of(cls, twist: Array, closing: BoolArray) -> "Errors":
        """Of twists (6, M, D)."""
        position, turn = np.sum(twist[:3] ** 2, axis=0), np.sum(twist[3:] ** 2, axis=0)
        found = (np.mean(position, axis=0), np.mean(turn, axis=0), np.max(position, axis=0))
        return cls(*(np.where(closing, np.sqrt(one), np.nan) for one in found))

    @classmethod
    def joined(cls, parts: Sequence["Errors"]) -> "Errors":
        """Of all machines, one after the other."""
        names = ("position", "orientation", "largest")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _stands(poses: PoseSet, parameters: Array) -> tuple[Poses, BoolArray]:
    """Poses (M D, machine after machine) at the commands of the nominal one; who closes, (D,)."""
    count = parameters.shape[1]
    near = poses.configuration.take(np.tile(np.arange(poses.count), count))
    held = np.repeat(parameters, poses.count, axis=1)
    found = forward(poses.machine, near.extension, held, near)
    return found.poses, np.asarray(found.converged.reshape(count, -1).all(axis=1))


def _apart(one: Poses, other: Poses, count: int) -> Array:
    """Twists (6, M, D) from one to the other."""
    return pose_difference(one, other).reshape(6, count, -1).transpose(0, 2, 1)


def uncalibrated(poses: PoseSet, draws: Sequence[Seed]) -> Errors:
    """Pose errors of machines within their tolerances that are commanded as if they were nominal.

    Parameters
    ----------
    poses : PoseSet of M
        Where they are looked at.
    draws : sequence of D seeds
        A machine is drawn by its own.
    """
    machine, each = poses.machine, max(1, TOGETHER // poses.count)
    parts = []
    for first in range(0, len(draws), each):
        some = draws[first : first + each]
        off = [np.random.default_rng(seed).standard_normal(machine.nominal.size) for seed in some]
        drawn = machine.nominal[:, None] + machine.prior_sigma[:, None] * np.array(off).T
        found, closing = _stands(poses, drawn)
        nominal = poses.poses.take(np.tile(np.arange(poses.count), len(some)))
        parts.append(Errors.of(_apart(nominal, found, len(some)), closing))
    return Errors.joined(parts)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """What calibrating D machines leaves at fresh poses.

    ``pulls`` (p, D): what is left of every unknown in its predicted standard uncertainty; nan of
    machines that do not close.
    """

    errors: Errors
    pulls: Array

    @classmethod
    def joined(cls, parts: Sequence["Calibrated"]) -> "Calibrated":
        """Of all machines, one after the other."""
        return cls(
            Errors.joined([part.errors for part in parts]),
            np.concatenate([part.pulls for part in parts], axis=1),
        )


def calibrated(poses: PoseSet, fresh: PoseSet, sights: Sights, draws: Sequence[Seed]) -> Calibrated:
    """Calibrate machines within their tolerances from readings with noise, and look at fresh poses.

    Parameters
    ----------
    poses, fresh : PoseSet
        Where they are measured, and where what is left is looked at: in the frame of the fit, if
        that is unknown.
    sights : Sights
        What is read. Frame and nests that are free begin where they are.
    draws : sequence of D seeds
    """
    shared = _Shared(poses, fresh, sights)
    each = max(1, TOGETHER // max(poses.count, fresh.count))
    parts = [shared.fit(draws[first : first + each]) for first in range(0, len(draws), each)]
    return Calibrated.joined(parts)


class _Shared:
    """What all machines have in common: derivatives of the nominal one, and their factors."""

    def __init__(self, poses: PoseSet, fresh: PoseSet, sights: Sights) -> None:
        self.poses, self.fresh, self.sights = poses, fresh, sights
        self.observation: Observation = observe(poses, sights)
        self.covariance = np.linalg.inv(
            self.observation.A.T @ self.observation.A + np.diag(self.observation.prior)
        )
        self.root = None if sights.pose_noise is None else sights.pose_noise.root(poses.poses)

    def fit(self, draws: Sequence[Seed]) -> Calibrated:
        """Draw, read and calibrate some machines."""
        seen, count = self.observation, len(draws)
        truth, noise = np.zeros((len(seen.names), count)), np.empty((len(seen.A), count))
        for number, seed in enumerate(draws):
            generator = np.random.default_rng(seed)
            truth[: seen.geometry, number] = generator.standard_normal(seen.geometry)
            noise[:, number] = generator.standard_normal(len(seen.A))
        where, closing = self._where(self.poses, truth)
        read = self._seen(where, truth) + noise
        found = np.zeros_like(truth)
        for _ in range(STEPS):
            where, closed = self._where(self.poses, found)
            left = read - self._seen(where, found)
            slope = seen.A.T @ np.where(closed, left, 0.0) - seen.prior[:, None] * found
            found = found + self.covariance @ slope
        real, there = self._where(self.fresh, truth)
        said, here = self._where(self.fresh, found)
        closing = closing & closed & there & here
        sigma = np.sqrt(np.diag(self.covariance))
        pulls = np.where(closing, (found - truth) / sigma[:, None], np.nan)
        return Calibrated(Errors.of(_apart(said, real, count), closing), pulls)

    def _where(self, poses: PoseSet, unknowns: Array) -> tuple[Poses, BoolArray]:
        """Poses (M D) in the instrument's frame for unknowns (p, D) in their scales."""
        seen, machine = self.observation, poses.machine
        natural = unknowns * seen.scale[:, None]
        stands, closing = _stands(poses, machine.nominal[:, None] + natural[: seen.geometry])
        if not self.sights.frame_free:
            return stands, closing
        frame = np.repeat(natural[seen.geometry : seen.geometry + 6], poses.count, axis=1)
        turn = exponential(frame[3:])
        moved = rotate(turn, stands.position) + frame[:3]
        return Poses(moved, product(turn, stands.rotation)), closing

    def _seen(self, where: Poses, unknowns: Array) -> Array:
        """What is read (rows, D) without noise, in standard uncertainties, in the rows' order."""
        sights, count = self.sights, unknowns.shape[1]
        if self.root is not None:
            nominal = self.poses.poses.take(np.tile(np.arange(self.poses.count), count))
            told = np.einsum("rin,ind->rnd", self.root, _apart(nominal, where, count))
            parts = [told.reshape(-1, count)]
        else:
            places = sights.nests[:, :, None] + self._nests_off(unknowns)
            parts = [self._points(where, place) / sights.sigma for place in places.swapaxes(0, 1)]
        if sights.frame_free and sights.base.shape[1]:
            parts.append(self._base(unknowns))
        return np.concatenate(parts)

    def _nests_off(self, unknowns: Array) -> Array:
        """How far nests are from where they are said to be, (3, nests, D), mm."""
        nests, count = self.sights.nests.shape[1], unknowns.shape[1]
        if not self.sights.nests_free:
            return np.zeros((3, nests, count))
        own = unknowns[-3 * nests :] * self.observation.scale[-3 * nests :, None]
        return np.asarray(own.reshape(nests, 3, count).swapaxes(0, 1))

    def _points(self, where: Poses, place: Array) -> Array:
        """One nest (3, D) at all poses, (3 M, D), mm."""
        count = place.shape[1]
        points = where.points(np.repeat(place, self.poses.count, axis=1))
        return np.asarray(points.reshape(3, count, -1).transpose(0, 2, 1).reshape(-1, count))

    def _base(self, unknowns: Array) -> Array:
        """Nests on the base: only the frame moves them, (3 B, D)."""
        sights, first = self.sights, self.observation.geometry
        frame = unknowns[first : first + 6] * self.observation.scale[first : first + 6, None]
        weight = np.sqrt(sights.base_reads) / sights.sigma
        turn = exponential(frame[3:])
        seen = [rotate(turn, nest[:, None]) + frame[:3] for nest in sights.base.T]
        return np.asarray(np.concatenate(seen) * weight)
