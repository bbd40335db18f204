"""What the tracker should read, and how that changes with every unknown.

A reading of run k in a platform nest n, taken at extension s:

    p = f_effects( R_k (x + X (n + dn)) + t_k ),   (x, X) = pose( s + ds ; parameters + dp )

and of a base nest b: p = f_effects(R_k b + t_k). (R_k, t_k) is the base frame in the tracker frame
of that run; ds, dp, dn and f come from the effects. Where readings are of other kinds the
components that are read follow from p (calib.model.observing). The unknowns and their order:
calib.model.unknowns.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.effects.component import Signature, Situation
from calib.effects.lever import apply, lever_of, through
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import cross, exponential, product, rotate
from calib.mechanism.solve import Configuration, begun_at, forward, home_configuration
from calib.model.columns import change_of, channels_known, whitened_columns
from calib.model.observing import Observed, observe
from calib.model.state import Derivatives, Linearised, State
from calib.model.unknowns import Unknowns
from calib.runs.stack import Rows
from calib.unknown import linear_among

SETTLING_PASSES = 4
AT_ONCE = 50_000
"""Parameters times readings whose twists are laid out at once."""
SETTLED = 1e-8
"""Change of extension, mm or rad, below which effects and pose agree."""


@dataclass(frozen=True, eq=False)
class _Settled:
    """A machine that is closed, with the parameters (P,) or (P, M) and effects it was closed with.

    ``signatures`` are of every effect with its linear amplitudes (U,).
    """

    closed: Configuration
    closing: Machine
    parameters: Array
    signatures: list[tuple[Array, Signature]]


class Model(Unknowns):
    """Baseline plus effects, for the readings of one or several runs."""

    @cached_property
    def usable(self) -> BoolArray:
        """Readings that have every channel that the effects need."""
        usable = np.ones(self.rows.count, dtype=bool)
        for effect in self.effects:
            usable &= channels_known(effect, self.rows)
        if self.rows.sensed is not None:
            far = np.flatnonzero(self.rows.sensed.partner >= 0)
            usable[far] &= usable[self.rows.sensed.partner[far]]
        return usable & ~self.rows.ghost

    @property
    def lacking(self) -> BoolArray:
        """Readings (N,) that lack a channel of an effect."""
        return ~self.usable & ~self.rows.ghost

    @cached_property
    def states(self) -> tuple[IntArray, IntArray]:
        """Representative readings (M,) of distinct machine states, and each reading's state."""
        depends = dict.fromkeys(name for e in self.effects for name in e.depends)
        columns = [self.rows.column(n) for n in depends if self.rows.has(n)]
        key = np.nan_to_num(np.concatenate([self.rows.extension, *columns]))
        order = np.lexsort(key[::-1])  # the first row counts most; of equal ones the first is first
        ahead = key[:, order]
        new = np.append(True, np.any(ahead[:, 1:] != ahead[:, :-1], axis=0))[: order.size]
        inverse = np.empty(order.size, dtype=np.intp)
        inverse[order] = np.cumsum(new) - 1
        return order[new], inverse

    @cached_property
    def nominal_configuration(self) -> Configuration:
        """The nominal machine closed at every distinct machine state."""
        first, _ = self.states
        extension = self.rows.extension[:, first]
        return self._closed(extension, self.machine.nominal, None, self.machine)

    def start(self, rotation: Array, position: Array) -> State:
        """Nominal parameters, effects at rest, frames (3, 3, K), (3, K)."""
        nominal = self.machine.nominal.copy()
        return State(
            nominal, self.effects_at_rest, rotation, position, self.nominal_configuration,
            self.setup.centre,
        )  # fmt: skip

    def base_points(self) -> Array:
        """SMR centres (3, N) of the nominal machine in the base frame, mm."""
        poses, (_, inverse) = self.nominal_configuration.poses, self.states
        turned = rotate(poses.rotation[:, :, inverse], self.rows.nest)
        return np.where(self.rows.on_platform, poses.position[:, inverse] + turned, self.rows.nest)

    def linearise(self, state: State) -> Linearised:
        """Predict all readings and differentiate.

        Raises
        ------
        BadInput
            Naming the reading at which the machine does not close.
        """
        rows, settled = self.rows, self._settled(state)
        closed, (_, inverse) = settled.closed, self.states
        jacobians = pose_jacobians(settled.closing, closed, settled.parameters)
        base, turned, point = self._placed(state, settled)
        seen_from, _ = _frames_of(state, rows)
        seen = self._observed(state, settled, point, settled.signatures)
        situation = Situation(
            rows=rows,
            passive_home=home_configuration(self.machine).passive[:, 0],
            actuator_twists=jacobians.actuators[:, :, inverse],
            state_twists=jacobians.parameters,
            base_point=base,
            point=point,
            frame_rotation=seen_from,
            closed=closed,
            state_of=inverse,
            parameters=settled.parameters,
            closing=settled.closing,
            slope=None if seen is None else seen.slope,
            turner=None if seen is None else seen.turner,
            read=None if seen is None else seen.value,
        )
        now = replace(state, near=situation)
        signatures = self._signatures(now)
        seen = self._observed(now, settled, point, signatures)
        if seen is None:
            residual = rows.position - point - change_of(signatures, "point", point)
            whitened = apply(rows.whitener, residual)
        else:
            residual, whitened = seen.misfit(rows.position)
        derivatives = Derivatives(partial(self._jacobian, now, signatures, turned))
        return Linearised(now, residual, whitened, derivatives)

    def _jacobian(
        self, state: State, signatures: list[tuple[Array, Signature]], turned: Array
    ) -> Array:
        """Whitened derivatives (p, 3, N) by all unknowns at a state that has its situation."""
        rows, situation = self.rows, state.situation
        assert situation is not None

        def parts() -> Iterator[Array]:
            each = max(1, AT_ONCE // max(rows.count, 1))
            for first in range(0, self.free.size, each):
                twists = situation.twists_of(self.free[first : first + each])
                yield rows.folded(through(situation.lever, twists))
            for _, signature in signatures:
                yield whitened_columns(signature, situation)
            if self.setup.unknowns:
                yield rows.folded(self.setup.columns(situation, state.setup))
            yield from self._frame_columns(turned, situation)

        jacobian, at = np.empty((self.prior.size, 3, rows.count)), 0
        for part in parts():
            jacobian[at : at + len(part)] = part
            at += len(part)
        return jacobian

    def predict(self, state: State) -> Array:
        """What the tracker should read (3, N), mm, without derivatives.

        Components as they are read: see :mod:`calib.model.observing` for other kinds.
        """
        settled = self._settled(state)
        _, _, point = self._placed(state, settled)
        seen = self._observed(state, settled, point, settled.signatures)
        if seen is None:
            return point + change_of(settled.signatures, "point", point)
        return seen.value

    def attitudes(self, state: State) -> Array:
        """Rotation (3, 3, N) of the platform in the frame of each reading."""
        return self._rotations(state, self._settled(state))

    def _observed(
        self,
        state: State,
        settled: "_Settled",
        point: Array,
        signatures: list[tuple[Array, Signature]],
    ) -> Observed | None:
        """What is read of points (3, N) in their frames; None where points themselves are."""
        if self.rows.sensed is None:
            return None
        moved = point + change_of(signatures, "point", point) * self.rows.optical
        ends = self.setup.ends(state.setup, self._rotations(state, settled))
        return observe(self.rows.sensed, moved, ends)

    def _rotations(self, state: State, settled: "_Settled") -> Array:
        """Attitudes (3, 3, N) of the platform in the frames."""
        (_, inverse) = self.states
        twist = change_of(settled.signatures, "twist", np.zeros((6, self.rows.count)))
        own = product(exponential(twist[3:]), settled.closed.poses.rotation[:, :, inverse])
        return product(_frames_of(state, self.rows)[0], own)

    def _placed(self, state: State, settled: "_Settled") -> tuple[Array, Array, Array]:
        """SMR centres (3, N): base frame; the same in the tracker's axes; tracker frame."""
        rows, poses, (_, inverse) = self.rows, settled.closed.poses, self.states
        nest = rows.nest if rows.sensed is None else self.setup.nests(state.setup)
        fixed, nest = nest, nest + change_of(settled.signatures, "nest", rows.nest)
        twist = change_of(settled.signatures, "twist", np.zeros((6, rows.count)))
        arm = rotate(poses.rotation[:, :, inverse], nest)
        bent = twist[:3] + cross(twist[3:], arm)
        base = np.where(rows.on_platform, poses.position[:, inverse] + arm + bent, fixed)
        rotation, position = _frames_of(state, rows)
        turned = rotate(rotation, base)
        return base, turned, turned + position

    def _settled(self, state: State) -> "_Settled":
        """Close the machine where its effects and its pose agree.

        An effect's extension depends on the pose that it changes, weakly: the two are iterated.
        """
        rows, (first, _) = self.rows, self.states
        started = any(np.any(linear) for linear in self._linear(state))
        if state.situation is None and started:
            without = self.effects_at_rest
            begun = self.linearise(replace(state, effects=without)).state
            state = replace(begun, effects=state.effects)
        closing = self._closing(state)
        moved = np.full_like(rows.extension, np.inf)
        for _ in range(SETTLING_PASSES):
            signatures = self._signatures(state)
            change = change_of(signatures, "extension", rows.extension)
            parameters: Array = state.parameters
            shaped = any(s.parameters is not None for _, s in signatures)
            if shaped:
                held = np.repeat(state.parameters[:, None], rows.count, axis=1)
                parameters = (held + change_of(signatures, "parameters", held))[:, first]
            extension = (rows.extension + change)[:, first]
            closed = self._closed(extension, parameters, state.configuration, closing)
            if not shaped and np.max(np.abs(change - moved), initial=0.0) < SETTLED:
                break
            if state.situation is None or not signatures:
                break
            moved = change
            here = replace(state.situation, closed=closed, parameters=parameters, closing=closing)
            state = replace(state, near=here)
        return _Settled(closed, closing, parameters, signatures)

    def _closing(self, state: State) -> Machine:
        """The machine as the effects let it close."""
        machine = self.machine
        for effect, values in zip(self.effects, state.effects, strict=True):
            machine = effect.closure(machine, values)
        return machine

    def _closed(
        self, extension: Array, parameters: Array, start: Configuration | None, machine: Machine
    ) -> Configuration:
        if start is not None:
            start = _carried(start, extension, machine)
        closed = forward(machine, extension, parameters, start)
        if not closed.converged.all():
            state = int(np.argmin(closed.converged))
            row = int(self.states[0][state])
            raise BadInput(
                "the machine does not close at these actuator coordinates",
                place=self.rows.place(row),
                remedy="Check q1.. of this row, and that the run belongs to this machine",
            )
        return closed

    def _signatures(self, state: State) -> list[tuple[Array, Signature]]:
        """Linear amplitudes (U,) and signature of every effect; none before the first closure."""
        if state.situation is None:
            return []
        return [
            (linear, effect.signature(state.situation, values))
            for effect, linear, values in zip(
                self.effects, self._linear(state), state.effects, strict=True
            )
        ]

    def _linear(self, state: State) -> list[Array]:
        """Values of every effect with zero in place of its nonlinear unknowns."""
        return [
            np.where(linear_among(group), values - effect.rest(self.rows), 0.0)
            for effect, group, values in zip(
                self.effects, self.unknowns, state.effects, strict=True
            )
        ]

    def _frame_columns(self, turned: Array, situation: Situation) -> list[Array]:
        rows = self.rows
        everywhere = np.ones(rows.count, dtype=bool)
        whitened = lever_of(situation.whitener, turned, everywhere).transpose(1, 0, 2)
        if situation.turner is not None:
            whitened[3:] += np.moveaxis(situation.turner, 1, 0)
        whitened = rows.folded(whitened)
        return [whitened * (rows.frame == frame) for frame in range(self.frames)]


def _frames_of(state: State, rows: Rows) -> tuple[Array, Array]:
    """Frame (3, 3, N), (3, N) in which each reading is: the base itself where it has none."""
    if rows.sensed is None:
        return state.frame_rotation[:, :, rows.run], state.frame_position[:, rows.run]
    # The base in itself comes last, which is where BASE, -1, points to.
    rotation = np.concatenate([state.frame_rotation, np.eye(3)[:, :, None]], axis=2)
    position = np.concatenate([state.frame_position, np.zeros((3, 1))], axis=1)
    return rotation[:, :, rows.frame], position[:, rows.frame]


def _carried(start: Configuration, extension: Array, machine: Machine) -> Configuration | None:
    """A configuration that can begin this closure; None for one of other states.

    A model with other effects may have other states; a closure with other elastic parts begins
    unstrained where the platform is.
    """
    if start.count != extension.shape[1]:
        return None
    like = home_configuration(machine)
    if start.passive.shape[0] != like.passive.shape[0]:
        return None
    if [one.shape[:2] for one in start.strain] == [one.shape[:2] for one in like.strain]:
        return start
    return begun_at(machine, start)
