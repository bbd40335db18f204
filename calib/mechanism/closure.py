"""The closure of a machine, linearised: the one derivation from which everything follows.

For limb i, with end frame T_i, passive twists P_i and platform frame X, to first order

    X moved by dx  =  T_i moved by P_i dtheta + t_e deps + a_v dv

(t_e: compliant elements, a_v: parameters and actuators; twists at the platform's origin). The
wrenches W_i reciprocal to P_i (its left null space) leave W_i^T (dx + r_i) = W_i^T a_v dv with
r_i the twist from T_i to X. All limbs stacked are Zhang eq. (19), Han eq. (3) and Feng eq. (6).
Where there are more rows than six, the compliant elements yield: limb i carries the wrench
W_i lambda_i, eps = c t^T W_i lambda_i, so G_i lambda_i = W_i^T (dx + r_i + sum t eps) with
G_i = W_i^T C_i W_i, and the platform is in equilibrium: sum W_i lambda_i = external wrench.

Twists are scaled: [v / size; omega]. Arrays are component first, pose last.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Numbers
from calib.mechanism.compiled import Compiled, Group, compile_machine
from calib.mechanism.description import Kind, Machine
from calib.mechanism.elastic import (
    RowWeights,
    backward_substitution,
    cholesky,
    driven_rows,
    forward_substitution,
    unit_force,
)
from calib.mechanism.householder import Reflectors, factorise
from calib.mechanism.rigid import cross, small_rotation
from calib.mechanism.sweep import Screw, Standing, sweep, twists_of


@dataclass(frozen=True, eq=False)
class LinearLimbs:
    """A group of limbs, linearised: passive twists factorised, wrenches, residual."""

    group: Group
    screws: tuple[Screw, ...]
    factors: Reflectors
    wrenches: Numbers
    """W (6, rows, L, N)."""
    gap: Numbers
    """r (6, L, N), scaled, from the limb's end to the platform, strains taken out."""
    residual: Numbers
    """W^T gap (rows, L, N)."""
    triangle: Numbers | None
    """Cholesky factor (rows, rows, L, N) of the flexibility; None for limbs that do not share."""
    weights: RowWeights | None
    """How the wrenches become rows of the closure; None where they are the rows."""

    @property
    def row_count(self) -> int:
        """Rows of all limbs of the group together."""
        return self.group.rows * self.group.count


def passive_twists(closure: "Closure", limb: LinearLimbs) -> Numbers:
    """Scaled twists (6, n_passive, L, N) of the passive coordinates of a group of limbs."""
    columns = list(limb.group.passive_columns)
    size = closure.machine.size
    return twists_of(limb.group, limb.screws, columns, closure.origin, size, closure.dtype)


class Closure:
    """Everything that one linearisation of a machine's closure gives.

    Parameters
    ----------
    machine : Machine
    parameters : (P, 1) or (P, N), mm or rad
    extension : (n, N), mm or rad
    state : Standing
        Where the machine is now.
    """

    def __init__(
        self, machine: Machine, parameters: Numbers, extension: Numbers, state: Standing
    ) -> None:
        self.machine = machine
        self.compiled: Compiled = compile_machine(machine)
        self.parameters = parameters
        self.origin = state.position[:, None, :]
        self.dtype = np.result_type(parameters, extension, state.position)
        self.limbs = [
            self._linearise(group, extension, state, state.strain[g])
            for g, group in enumerate(self.compiled.groups)
        ]

    def _linearise(
        self, group: Group, extension: Numbers, state: Standing, strain: Numbers
    ) -> LinearLimbs:
        size = self.machine.size
        point, rotation, screws = sweep(group, self.parameters, extension, state, strain)
        passive = twists_of(
            group, screws, list(group.passive_columns), self.origin, size, self.dtype
        )
        factors = factorise(passive)
        gap = np.empty((6, group.count, self.origin.shape[-1]), dtype=self.dtype)
        np.divide(self.origin - point, size, out=gap[:3])
        gap[3:] = small_rotation(rotation, state.rotation[:, :, None])
        if group.compliant:
            yielding = self._compliant_twists(group, screws)
            gap += np.einsum("icln,cln->iln", yielding, strain)
        W = factors.null_space()
        residual = np.einsum("irln,iln->rln", W, gap)
        triangle, weights = None, None
        if self.compiled.redundant:
            triangle = cholesky(self._flexibility(group, screws, W))
            weights = self._weights(group, screws, W, triangle)
        return LinearLimbs(group, screws, factors, W, gap, residual, triangle, weights)

    def _compliant_twists(self, group: Group, screws: tuple[Screw, ...]) -> Numbers:
        columns: list[tuple[tuple[int, Array | None], ...]] = [
            ((k, None),) for k in group.compliant
        ]
        return twists_of(group, screws, columns, self.origin, self.machine.size, self.dtype)

    def _flexibility(self, group: Group, screws: tuple[Screw, ...], W: Numbers) -> Numbers:
        """G = W^T C W (rows, rows, L, N): how far the limb yields along its own wrenches."""
        yielding = self._compliant_twists(group, screws)
        along = np.einsum("icln,irln->crln", yielding, W)
        G: Numbers = np.einsum("crln,csln->rsln", group.compliances[:, None] * along, along)
        return G

    def _weights(
        self, group: Group, screws: tuple[Screw, ...], W: Numbers, triangle: Numbers
    ) -> RowWeights:
        def answers(elements: tuple[int, ...]) -> Numbers:
            columns: list[tuple[tuple[int, Array | None], ...]] = [((k, None),) for k in elements]
            moved = twists_of(group, screws, columns, self.origin, self.machine.size, self.dtype)
            found: Numbers = np.einsum("irln,icln->rcln", W, moved)
            return found

        if group.published_rows is not None:
            published = []
            for row in group.published_rows:
                idle = None if row.idle is None else answers((row.idle,))
                force = unit_force(W, idle, self.machine.size)
                if row.spans is not None:
                    force = force * self._area(screws, row.spans)
                published.append(force)
            return RowWeights(None, np.stack(published, axis=1))
        if group.released and group.rows < group.wrenches:
            driven = forward_substitution(triangle, answers(group.driven))
            return RowWeights(triangle, driven_rows(driven))
        return RowWeights(triangle, None)

    def _area(self, screws: tuple[Screw, ...], spans: tuple[int, int, int]) -> Numbers:
        """Area (L, N) that the velocities of two joints span at a third, over size squared."""
        first, second, at = (screws[k] for k in spans)
        normal = cross(first.velocity(at), second.velocity(at)) / self.machine.size**2
        area: Numbers = np.sqrt(np.einsum("iln,iln->ln", normal, normal))
        return area

    def rows(self) -> tuple[Numbers, Numbers]:
        """Rows A (m, 6, N) and gaps b (m, N) with A dx = -b for a closed machine.

        Over-constrained rows are whitened by their flexibility, so that least squares over them
        is the elastic equilibrium.
        """
        rows, gaps = [], []
        for limb in self.limbs:
            if not limb.row_count:
                continue
            W, b = limb.wrenches.swapaxes(0, 1), limb.residual
            if limb.weights is not None:
                W, b = limb.weights.apply(W), limb.weights.apply(b)
            m = W.shape[0] * W.shape[2]
            rows.append(W.swapaxes(1, 2).reshape(m, 6, -1))
            gaps.append(b.reshape(m, -1))
        return np.concatenate(rows), np.concatenate(gaps)

    def strain(self, limb: LinearLimbs, twist: Numbers) -> tuple[Numbers, Numbers | None]:
        """Strains (n_compliant, L, N) of a limb pulled by ``twist`` (6, L, N), and their twist.

        A machine whose limbs are not redundant carries no wrench: nothing yields.
        """
        if limb.triangle is None:
            return np.zeros((len(limb.group.compliant), *twist.shape[1:])), None
        along = np.einsum("irln,iln->rln", limb.wrenches, twist)
        wrench = backward_substitution(limb.triangle, forward_substitution(limb.triangle, along))
        force = np.einsum("irln,rln->iln", limb.wrenches, wrench)
        yielding = self._compliant_twists(limb.group, limb.screws)
        strain = limb.group.compliances * np.einsum("icln,iln->cln", yielding, force)
        return strain, np.einsum("icln,cln->iln", yielding, strain)

    def actuator_twist(self, limb: LinearLimbs, ds: Numbers) -> Numbers:
        """Scaled twist (6, L, N) of the limb's end for extension steps ds (n, N)."""
        out = np.zeros_like(limb.gap)
        part = np.empty_like(limb.gap)
        for element, screw in zip(limb.group.elements, limb.screws, strict=True):
            for term in element.terms:
                if term.kind != "actuator":
                    continue
                screw.twist(self.origin, self.machine.size, part)
                share = ds[term.index]
                out += part * (share if term.factor is None else term.factor * share)
        return out

    def columns(self, kind: Kind) -> Iterator[tuple[int, slice, Numbers]]:
        """Answer of the rows of :meth:`rows` to each variable of a kind, limb by limb.

        Yields (variable, rows, coefficients (len(rows), N)): W^T a_v of one element of one limb.
        A variable that stands in several elements comes several times.
        """
        offset = 0
        for limb in self.limbs:
            if not limb.row_count:
                continue
            for element, screw in zip(limb.group.elements, limb.screws, strict=True):
                for term in element.terms:
                    if term.kind != kind:
                        continue
                    answer = self._answer(limb, screw)
                    if term.factor is not None:
                        answer = term.factor * answer
                    for i, variable in enumerate(term.index):
                        rows = slice(offset + i, offset + limb.row_count, limb.group.count)
                        yield int(variable), rows, answer[:, i]
            offset += limb.row_count

    def column(self, limb: int, element: int) -> tuple[slice, Numbers]:
        """Rows, and their answer (len(rows), N), to one element of one limb, fixed ones included.

        As :meth:`columns`; without rows where the limb's group carries no wrench.
        """
        offset = 0
        for group in self.limbs:
            if limb in group.group.limbs:
                i = group.group.limbs.index(limb)
                answer = self._answer(group, group.screws[element])[:, i]
                return slice(offset + i, offset + group.row_count, group.group.count), answer
            offset += group.row_count
        raise IndexError(limb)

    def _answer(self, limb: LinearLimbs, screw: Screw) -> Numbers:
        W, size = limb.wrenches, self.machine.size
        answer: Numbers
        if screw.point is None:
            answer = np.einsum("irln,iln->rln", W[:3], screw.direction / size)
        else:
            moment = cross(screw.direction, self.origin - screw.point) / size
            answer = np.einsum("irln,iln->rln", W[:3], moment)
            answer += np.einsum("irln,iln->rln", W[3:], screw.direction)
        return answer if limb.weights is None else limb.weights.apply(answer)
