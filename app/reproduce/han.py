"""Han et al. 2020: the hexapod. What was simulated, and our simulations of the same."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from app.files.machines import load_machine
from app.reproduce.papers import paper
from app.reproduce.pose_fit import PoseFit, fit_poses
from calib.arrays import Array, IntArray
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import within_limits
from calib.mechanism.rigid import Poses, exponential, pose_difference, product
from calib.mechanism.solve import Configuration, forward, home_configuration, inverse
from calib.mechanism.survey import closure_at
from calib.poses import sample_poses
from calib.poses.design import design_poses
from calib.poses.readings import HAN_2020

DEG = np.pi / 180.0
KINDS = ("L0", "P_x", "P_y", "P_z", "B_x", "B_y", "B_z", "L_B", "L_P")
"""The order of figure 4: limbs, upper joints, lower joints, offsets."""
WIDE = {"L_B": 0.1, "L_P": 0.1}
"""Half-widths of table 2's errors in mm, where not 1 mm."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated calibration: largest parameter deviation (mm) and RMS position at fresh poses
    (mm); the fit itself.
    """

    deviation: float
    position: float
    fit: PoseFit


class Han:
    """The study; what several rows and figures need is computed once."""

    def __init__(self) -> None:
        self.machine: Machine = load_machine("hexapod")
        self.numbers: dict[str, Any] = paper("han")
        self.truth = self.vector("table2")
        half = [WIDE.get(p.name.split(".")[1], 1.0) for p in self.machine.parameters]
        self.prior: Array = np.array(half) / np.sqrt(3.0)

    def vector(self, table: str, like: Array | None = None) -> Array:
        """Parameters (54,) of a table, or its errors added to ``like``; zero if not printed."""
        told = self.numbers[table]
        values = np.zeros(54) if like is None else like.copy()
        for kind in KINDS:
            for i in range(6):
                values[self.machine.index(f"leg{i + 1}.{kind}")] += np.nan_to_num(told[kind][i])
        return values

    @cached_property
    def figure_order(self) -> IntArray:
        """Indices of the parameters in the order of figure 4."""
        names = [f"leg{i + 1}.{kind}" for kind in KINDS for i in range(6)]
        return np.array([self.machine.index(name) for name in names])

    def poses(self, count: int, rng: np.random.Generator) -> Configuration:
        """Random reachable poses of the nominal machine."""
        return sample_poses(self.machine, count, rng).configuration

    @cached_property
    def fresh(self) -> Configuration:
        """Poses on which accuracy is judged."""
        return self.poses(400, np.random.default_rng(99))

    def measured(self, start: Configuration, truth: Array, rng: np.random.Generator) -> Poses:
        """Poses of the real machine with the paper's noise, uniform in each coordinate."""
        told = self.numbers["simulation"]
        real = forward(self.machine, start.extension, truth, start=start).poses
        shift = told["noise_position"] * rng.uniform(-1, 1, (3, start.count))
        turn = told["noise_orientation_deg"] * DEG * rng.uniform(-1, 1, (3, start.count))
        return Poses(real.position + shift, product(exponential(turn), real.rotation))

    @property
    def sigma(self) -> Array:
        """Standard deviations of that noise, (6,)."""
        told = self.numbers["simulation"]
        half = [told["noise_position"], told["noise_orientation_deg"] * DEG]
        found: Array = np.repeat(half, 3) / np.sqrt(3.0)
        return found

    def leg_weights(self, start: Configuration) -> Array:
        """Rows (6, 6, N) that turn a pose's error into leg lengths: the paper's residual."""
        rows = closure_at(self.machine, start).rows()[0].copy()
        rows[:, :3] /= self.machine.size
        rows /= np.linalg.norm(rows[:, :3], axis=1)[:, None]
        return rows

    def left(self, truth: Array, values: Array, where: Configuration) -> Array:
        """Twists (6, N) between what a calibrated model says and what the machine does."""
        real = forward(self.machine, where.extension, truth, start=where).poses
        model = forward(self.machine, where.extension, values, start=where).poses
        return pose_difference(model, real)

    def trial(
        self,
        start: Configuration,
        rng: np.random.Generator,
        *,
        legs: bool = False,
        noise: bool = True,
        free: IntArray | None = None,
        prior: bool = False,
    ) -> Trial:
        """Measure ``start`` on table 2's machine, identify, judge.

        ``legs``: minimise leg lengths as the paper does, not poses weighted by their noise.
        """
        measured = self.measured(start, self.truth, rng)
        if not noise:
            measured = forward(self.machine, start.extension, self.truth, start=start).poses
        weights = self.leg_weights(start) if legs else self.sigma
        fit = fit_poses(self.machine, start, measured, weights, free, self.prior if prior else None)
        left = self.left(self.truth, fit.values, self.fresh)
        position = float(np.sqrt(np.mean(np.sum(left[:3] ** 2, axis=0))))
        return Trial(float(np.max(np.abs(fit.values - self.truth))), position, fit)

    def trials(self, count: int, poses: int, seed: int, *, legs: bool = False) -> list[Trial]:
        """Several trials with fresh poses and noise each."""
        rng = np.random.default_rng(seed)
        return [self.trial(self.poses(poses, rng), rng, legs=legs) for _ in range(count)]

    @cached_property
    def exact(self) -> list[Trial]:
        """Nine random poses without noise, several times."""
        rng = np.random.default_rng(4)
        return [self.trial(self.poses(9, rng), rng, noise=False) for _ in range(11)]

    @cached_property
    def random_29(self) -> list[Trial]:
        """Trials with 29 random poses, weighted by the noise."""
        return self.trials(25, 29, 1)

    @cached_property
    def random_256(self) -> list[Trial]:
        """Trials with 256 random poses, weighted by the noise."""
        return self.trials(3, 256, 256)

    @cached_property
    def chosen_29(self) -> Configuration:
        """29 poses chosen for the predicted pose error, the paper's noise."""
        rng = np.random.default_rng(20)
        design = design_poses(
            self.machine, HAN_2020, 29, rng, priors=False, candidates=2000, counts=()
        )
        return design.pose_set.configuration

    @cached_property
    def optimal_29(self) -> Trial:
        """Calibration with the chosen poses and priors as wide as table 2's errors."""
        return self.trial(self.chosen_29, np.random.default_rng(5), prior=True)

    @cached_property
    def without_offsets(self) -> Trial:
        """L_B and L_P held at nominal, 256 poses without noise: the non-complete model."""
        names = [p.name for p in self.machine.parameters]
        free = np.array([k for k, n in enumerate(names) if n[-3:] not in ("L_B", "L_P")])
        rng = np.random.default_rng(6)
        return self.trial(self.poses(256, rng), rng, noise=False, free=free)

    @cached_property
    def meeting_axes(self) -> float:
        """RMS position in mm of a model whose axes meet (LB = LP = 0), 256 poses, no noise."""
        machine = load_machine("hexapod-universal")
        rng = np.random.default_rng(7)
        start = self.poses(256, rng)
        measured = forward(self.machine, start.extension, self.truth, start=start).poses
        begin = inverse(machine, start.poses)
        # Legs count from the hexapod's home length in both: same commands, same extensions.
        extension = start.extension + 230.715 - machine.home_q[:, None]
        begin = forward(machine, extension, start=begin)
        fit = fit_poses(machine, begin, measured, self.sigma)
        extension = self.fresh.extension + 230.715 - machine.home_q[:, None]
        near = inverse(machine, self.fresh.poses)
        model = forward(machine, extension, fit.values, start=near).poses
        real = forward(self.machine, self.fresh.extension, self.truth, start=self.fresh).poses
        gap = model.position - real.position
        return float(np.sqrt(np.mean(np.sum(gap**2, axis=0))))

    @cached_property
    def corners(self) -> tuple[int, Poses]:
        """How many of the 64 corners of table 3 are within the stroke, and the rays to them."""
        names = self.machine.task.coordinates
        low, high = np.array([self.machine.workspace[c] for c in names]).T
        box = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(6, 64)
        usable = int(np.count_nonzero(within_limits(self.machine, inverse(self.machine, box))))
        return usable, Poses.from_xyz_rpy(box)

    @cached_property
    def corner_rays(self) -> Configuration:
        """The farthest reachable pose on the ray from home to each corner."""
        corners = self.corners[1].to_xyz_rpy()
        home = home_configuration(self.machine).poses.to_xyz_rpy()
        near, far = np.zeros(64), np.ones(64)
        for _ in range(24):
            middle = 0.5 * (near + far)
            found = inverse(self.machine, home + middle * (corners - home))
            inside = within_limits(self.machine, found)
            near, far = np.where(inside, middle, near), np.where(inside, far, middle)
        return inverse(self.machine, home + near * (corners - home))

    @cached_property
    def observability(self) -> Array:
        """Figure 10: condition number (5, 36) of the identification matrix for 9 to 44 poses.

        Greedy from nine random corners, one by one; rows whitened by the noise, parameters in mm.
        """
        J = pose_jacobians(self.machine, self.corner_rays).parameters / self.sigma[:, None]
        information = np.einsum("pin,qin->npq", J, J)
        rng = np.random.default_rng(10)
        curves = np.empty((5, 36))
        for k in range(5):
            left = list(rng.permutation(64))
            total = information[[left.pop() for _ in range(9)]].sum(axis=0)
            for step in range(36):
                curves[k, step] = _condition(total[None])[0]
                index = int(np.argmin(_condition(total + information[left])))
                total = total + information[left.pop(index)]
        return curves

    def condition(self, poses: Array) -> Array:
        """Figures 7, 8: condition number (N,) of J_1 for poses (6, N), turns at 100 mm."""
        found = inverse(self.machine, poses)
        rows = closure_at(self.machine, found).rows()[0] * np.repeat([1.0, 1.0], 3)[:, None]
        rows[:, 3:] *= self.machine.size / 100.0
        condition: Array = np.linalg.cond(np.moveaxis(rows, -1, 0))
        return condition

    @cached_property
    def prototype_values(self) -> Array:
        """Parameters (54,) that a calibration of table 5's machine finds.

        29 chosen poses, three nests each read with the tracker's noise, tolerance priors.
        """
        truth = self.vector("table5", self.machine.nominal)
        rng = np.random.default_rng(12)
        told = self.numbers["tracker"]
        noise = (told["constant"] + told["per_metre"] * told["distance"]) / 2.0
        nests = 100.0 * np.array([[0.0, 1.0, 0.0], [-0.866, -0.5, 0.0], [0.866, -0.5, 0.0]]).T
        start = self.chosen_29
        real = forward(self.machine, start.extension, truth, start=start).poses
        shift, turn = _pose_noise(nests, noise, start.count, rng)
        measured = Poses(real.position + shift, product(exponential(turn), real.rotation))
        sigma = np.concatenate([np.std(shift, axis=1), np.std(turn, axis=1)])
        prior = self.machine.prior_sigma
        return fit_poses(self.machine, start, measured, sigma, None, prior).values

    @cached_property
    def prototype(self) -> tuple[Array, Array]:
        """Table 6 simulated: twists (6, 216) before and after calibration of table 5's machine."""
        truth = self.vector("table5", self.machine.nominal)
        where = self.verification
        nominal = self.left(truth, self.machine.nominal, where)
        return nominal, self.left(truth, self.prototype_values, where)

    @cached_property
    def verification(self) -> Configuration:
        """216 poses: 27 nodes of the box, eight random turns each, shrunk until reachable."""
        rng = np.random.default_rng(13)
        axis = np.linspace(-1.0, 1.0, 3)
        nodes = np.array(np.meshgrid(axis, axis, axis)).reshape(3, 27).repeat(8, axis=1)
        xyz = nodes * np.array([[25.0], [25.0], [20.0]]) + np.array([[0.0], [0.0], [220.0]])
        turns = np.array([[15.0], [15.0], [20.0]]) * DEG * rng.uniform(-1, 1, (3, 216))
        home = np.array([0.0, 0.0, 220.0, 0.0, 0.0, 0.0])[:, None]
        wanted = np.concatenate([xyz, turns])
        share = np.ones(216)
        for _ in range(30):
            found = inverse(self.machine, home + share * (wanted - home))
            share = np.where(within_limits(self.machine, found), share, 0.93 * share)
        return inverse(self.machine, home + share * (wanted - home))


def _condition(information: Array) -> Array:
    """Condition numbers (n,) of matrices J from J^T J (n, p, p)."""
    values = np.linalg.eigvalsh(information)
    found: Array = np.sqrt(values[:, -1] / np.maximum(values[:, 0], 1e-300))
    return found


def _pose_noise(
    nests: Array, noise: float, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Errors of poses found from three nests read with white noise: shift, turn (3, N)."""
    rows = [np.hstack([np.eye(3), -np.cross(np.eye(3), nest)]) for nest in nests.T]
    inverse_rows = np.linalg.pinv(np.vstack(rows))
    found = inverse_rows @ (noise * rng.normal(size=(9, count)))
    return found[:3], found[3:]
