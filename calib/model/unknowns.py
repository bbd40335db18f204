"""What a model does not know, in which order, and what is known of it beforehand.

The machine's parameters that have a prior, the effects' unknowns, the setup's (calib.model.setup),
six for each frame (dt in mm, then a rotation vector dw in rad about the tracker's axes,
R <- exp(dw) R).
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import exponential, product
from calib.model.columns import at_trial
from calib.model.setup import SetupUnknowns
from calib.model.state import State
from calib.runs.stack import Rows
from calib.unknown import Unknown, linear_among


class Unknowns:
    """The vector (p,) of everything that is found from the readings of one or several runs.

    Parameters
    ----------
    rows : Rows
    effects : sequence of Effect
        In the order in which they were added; combinations act together.
    """

    def __init__(self, rows: Rows, effects: Sequence[Effect] = ()) -> None:
        self.rows = rows
        self.effects = tuple(effects)
        self.machine: Machine = rows.machine
        for effect in self.effects:
            if reason := effect.unavailable(rows):
                raise BadInput(
                    f"the effect {effect.id} cannot be in the model: {reason}",
                    remedy="Leave it out, or measure with what it needs",
                )

    @cached_property
    def free(self) -> IntArray:
        """Indices of the machine's parameters that are unknown (their prior is not zero)."""
        return np.flatnonzero(self.machine.prior_sigma > 0)

    @cached_property
    def unknowns(self) -> tuple[tuple[Unknown, ...], ...]:
        """Unknowns of every effect."""
        return tuple(effect.unknowns(self.rows) for effect in self.effects)

    @cached_property
    def frames(self) -> int:
        """Number of base frames, one for each run (for each instrument that has its own)."""
        return len(self.rows.frames)

    @cached_property
    def setup(self) -> SetupUnknowns:
        """What of the measuring setup is not exact."""
        return SetupUnknowns(self.rows)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all unknowns, in order."""
        parameters = tuple(self.machine.parameters[index].name for index in self.free)
        prefix = self._frame_names()
        frame = tuple(f"{p}.{c}" for p in prefix for c in ("x", "y", "z", "rx", "ry", "rz"))
        effects = tuple(u.name for group in self.unknowns for u in group)
        return parameters + effects + tuple(u.name for u in self.setup.unknowns) + frame

    def _frame_names(self) -> list[str]:
        """``frame``; ``run2.frame`` of several runs; ``NAME.frame`` of several instruments."""
        frames, several = self.rows.frames, len(self.rows.runs) > 1
        per_run = [sum(one.run == other.run for other in frames) for one in frames]
        return [
            (f"run{one.run + 1}." if several else "")
            + (f"{one.instrument}." if count > 1 else "")
            + "frame"
            for one, count in zip(frames, per_run, strict=True)
        ]

    @cached_property
    def prior(self) -> Array:
        """Standard deviation of the prior of every unknown (p,); infinite for frames."""
        effects = [u.prior_sigma for group in self.unknowns for u in group]
        parameters = self.machine.prior_sigma[self.free]
        return np.concatenate(
            [parameters, effects, self.setup.sigma, np.full(6 * self.frames, np.inf)]
        )

    @cached_property
    def centre(self) -> Array:
        """Mean of the prior of every unknown (p,); zero for effects and frames."""
        centre = np.zeros(self.prior.size)
        centre[: self.free.size] = self.machine.nominal[self.free]
        centre[self._setup_columns] = self.setup.centre
        return centre

    @property
    def _setup_columns(self) -> slice:
        """Where the unknowns of the setup stand among all."""
        end = self.prior.size - 6 * self.frames
        return slice(end - len(self.setup.unknowns), end)

    @property
    def effects_at_rest(self) -> tuple[Array, ...]:
        """Values (U,) of effects that do nothing, nonlinear unknowns at a first trial."""
        return tuple(
            at_trial(group, next(iter(effect.trials(self.rows)))) + effect.rest(self.rows)
            for effect, group in zip(self.effects, self.unknowns, strict=True)
        )

    def moved(self, state: State, step: Array) -> State:
        """Take a step (p,) of all unknowns; the configuration stays as a warm start."""
        parameters = state.parameters.copy()
        parameters[self.free] += step[: self.free.size]
        at, effects = self.free.size, []
        for group, values in zip(self.unknowns, state.effects, strict=True):
            moved = values + step[at : at + values.size]
            scanned = ~linear_among(group)
            # A period or a time constant has a sign: it moves by half of itself at most.
            near = np.clip(moved, 0.5 * values, 1.5 * values)
            effects.append(np.where(scanned & (values > 0), near, moved))
            at += values.size
        setup = state.setup + step[at : at + state.setup.size]
        frame = step[at + state.setup.size :].reshape(self.frames, 6).T
        return replace(
            state,
            parameters=parameters,
            effects=tuple(effects),
            frame_rotation=product(exponential(frame[3:]), state.frame_rotation),
            frame_position=state.frame_position + frame[:3],
            setup=setup,
        )

    def deviation(self, state: State) -> Array:
        """Distance (p,) of every unknown from the mean of its prior, in its own unit.

        Nonlinear unknowns have been searched for: their priors hold them where they were found.
        """
        own = np.concatenate([state.parameters[self.free], *state.effects, state.setup])
        deviation = np.zeros(self.prior.size)
        deviation[: own.size] = own - self.centre[: own.size]
        scanned = ~linear_among(unknown for group in self.unknowns for unknown in group)
        deviation[self.free.size : self.free.size + scanned.size][scanned] = 0.0
        return deviation
