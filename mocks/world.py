"""The one physical machine behind a station's servers, and the room around it.

Everything is a function of machine time, so any thread may ask for any instant and nothing has
to be stepped. Poses come from the machine's body (``mocks.physics.bodies``).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calib.mechanism.description import Machine
from mocks.clock import Clock, ScaledClock
from mocks.faults import FaultSet
from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load, play_widths, true_load
from mocks.physics.bodies import body_named, body_of
from mocks.physics.body import Body, Surroundings
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.climate import Climate
from mocks.physics.motion import LegMotion
from mocks.physics.pose import Array, Pose, rotation_from_rpy, rotation_from_vector
from mocks.physics.room import HOME_REFLECTOR, Distortions, Station
from mocks.physics.signals import Steps
from mocks.physics.stand import Stand
from mocks.physics.truth import draw_parameters
from mocks.smrs import BIRDBATH, HAND, Smrs

HAND_AWAY = (0.0, 0.0, -1000.0)
SLOW_TAU_S = 1.0
"""Correlation time of the slow part of a tracker's noise."""


@dataclass(frozen=True)
class WorldPlan:
    """How a world is made.

    ``machine`` names the body; ``own`` is one's own machine with such a body; ``body`` is a body
    itself. ``parameters`` are the true ones (drawn by ``seed`` if None); ``load`` that of the
    body's surroundings if None. ``smrs``: one SMR, in the birdbath, or three, in the platform's
    nests. ``base_smrs``: each base nest holds its own. ``noise_tau_s``: how slow the slow part of
    the tracker's noise is; where that is longer than a dwell, successive readings err alike.
    """

    seed: int = 1
    parameters: Mapping[str, float] | None = None
    hidden: Hidden = field(default_factory=Hidden)
    load: Load | None = None
    smrs: int = 1
    base_smrs: bool = True
    machine: str = "hexapod"
    own: Machine | None = None
    body: Body | None = None
    noise_tau_s: float = SLOW_TAU_S


class World:
    """Actuators (``legs``), platform, SMRs, tracker, climate and faults on one machine clock."""

    def __init__(self, clock: Clock | None = None, plan: WorldPlan | None = None) -> None:
        plan = plan or WorldPlan()
        self.clock: Clock = clock or ScaledClock()
        self.plan = plan
        named = body_of(plan.own) if plan.own is not None else body_named(plan.machine)
        self.body = plan.body or named
        self.machine, self.around = self.body.machine, self.body.around
        self.load = plan.load or self.around.load
        given = plan.parameters
        self.parameters: dict[str, float] = (
            dict(given) if given is not None else draw_parameters(self.machine, plan.seed)
        )
        carried = true_load(self.load, plan.hidden, self.body.limbs, self.body.stroke)
        self._real = self.body.real(self.parameters, plan.hidden, carried, True)
        self._stand = Stand(plan.hidden, self.body, carried)
        self.faults = FaultSet()
        self.climate = Climate(plan.seed)
        self.station = Station(plan.seed, self.around.place, _seen(self.around, self.machine))
        self.distortions = Distortions(plan.hidden, self.body)
        widths = play_widths(plan.hidden, self.body.limbs, self.body.stroke)
        self.legs = [LegMotion(self.clock, width) for width in widths]
        self.smrs = _smrs(plan, self.around)
        self._payload = Steps(np.zeros(()))
        self._jump = Steps(np.zeros(6))
        self._last: Pose | None = None

    @property
    def kind(self) -> str:
        """Name of the body."""
        return self.body.kind

    @property
    def unit(self) -> str:
        """Unit of the actuators."""
        return self.machine.actuators[0].unit

    @property
    def stroke(self) -> Stroke:
        """How large a move is, in the actuators' unit."""
        return self.body.stroke

    @property
    def payload_kg(self) -> float:
        """Mass of the payload on the platform, kg."""
        return float(self._payload.last)

    @payload_kg.setter
    def payload_kg(self, mass: float) -> None:
        self._payload.set(self.clock.now(), np.asarray(mass))

    def structure_temp_C(self) -> float:  # noqa: N802 (the unit's own capital)
        """Temperature of the machine's structure now, deg C, as its sensor reads it."""
        return round(float(self.climate.structure(np.array([self.clock.now()]))[0]), 3)

    def jump_tracker(self, move: Array) -> None:
        """Somebody knocks the tracker's stand: ``move`` (6,) = mm and rad, tracker frame."""
        self._jump.set(self.clock.now(), self._jump.last + np.asarray(move, dtype=float))

    def pose(self, times: Array) -> Pose:
        """True poses of the platform in the base frame at ``times`` (N,).

        Where the actuators do not close (opposite ends of their strokes) the platform jams: it
        stays where it was last, and the fault ``jammed`` stands.
        """
        circumstances = self._circumstances(times)
        start = self._start(times.size)
        try:
            pose = self._real.poses(circumstances, start)
        except (ArithmeticError, np.linalg.LinAlgError):
            self.faults.inject("jammed")
            return start
        self._last = Pose(pose.position[-1:], pose.rotation[-1:])
        return self._stand.under(pose, circumstances.payload)

    def encoder_extension(self) -> Array:
        """Extension of every actuator as its encoder reads it now, (n,), mm or rad."""
        return np.array([leg.position() for leg in self.legs])

    def smr_in_tracker(self, smr: str, times: Array) -> Array:
        """Where the centre of an SMR really is at ``times`` (N,), tracker frame, (N, 3), mm."""
        place = self.smrs.places[smr]
        pose = self.pose(times) if place in self.around.platform_nests else None
        return self._smr_at(smr, place, times, pose)

    def all_smrs(self, time: float) -> dict[str, Array]:
        """Where the centre of every SMR really is at one instant, tracker frame, (3,), mm."""
        times, places = np.array([time]), self.smrs.places
        pose = self.pose(times) if set(places.values()) & set(self.around.platform_nests) else None
        return {smr: self._smr_at(smr, place, times, pose)[0] for smr, place in places.items()}

    def nest_in_tracker(self, nest: str, times: Array) -> Array:
        """Where a nest really is at ``times`` (N,), tracker frame, (N, 3), mm."""
        return self._nest_at(
            nest, times, self.pose(times) if nest in self.around.platform_nests else None
        )

    def nest_in_base(self, nest: str, times: Array) -> Array:
        """Where a nest of the platform really is at ``times`` (N,), base frame, (N, 3), mm."""
        return np.asarray(self.pose(times).points(np.array(self.around.platform_nests[nest])))

    def _smr_at(self, smr: str, place: str, times: Array, pose: Pose | None) -> Array:
        if place == BIRDBATH:
            return np.tile(HOME_REFLECTOR, (times.size, 1))
        if place == HAND:
            return np.tile(HAND_AWAY, (times.size, 1))
        return self._nest_at(place, times, pose, self.smrs.centre_off_mm(smr))

    def _nest_at(self, nest: str, times: Array, pose: Pose | None, off_mm: float = 0.0) -> Array:
        centre = np.array({**self.around.platform_nests, **self.around.base_nests}[nest])
        centre[2] += off_mm
        if pose is None or nest in self.around.base_nests:
            level = np.zeros((times.size, 3))
            return self._to_tracker(self.distortions.nest(nest, centre, times, level), times)
        down = -pose.rotation[:, 2, :]
        base = pose.points(self.distortions.nest(nest, centre, times, down))
        return self._to_tracker(base, times)

    def _to_tracker(self, base: Array, times: Array) -> Array:
        points = self.station.to_tracker(self.distortions.base(base, times))
        jump = self._jump.at(times)
        turned = np.einsum("nij,nj->ni", rotation_from_vector(jump[:, 3:]), points)
        return np.asarray(turned + jump[:, :3])

    def _circumstances(self, times: Array) -> Circumstances:
        history = [leg.history(times) for leg in self.legs]
        return Circumstances(
            extension=np.stack([h.extension for h in history], axis=1),
            play=np.stack([h.play for h in history], axis=1),
            step=np.stack([h.step for h in history], axis=1),
            delay=np.stack([h.delay for h in history], axis=1),
            structure=self.climate.structure(times),
            air=self.climate.air(times),
            payload=self._payload.at(times),
            remembered=lambda tau: np.stack(
                [leg.remembered(times, tau) for leg in self.legs], axis=1
            ),
            time=times,
        )

    def _start(self, count: int) -> Pose:
        if self._last is None:
            return self._real.home(count)
        last = self._last
        return Pose(np.repeat(last.position, count, 0), np.repeat(last.rotation, count, 0))


def _seen(around: Surroundings, machine: Machine) -> Array:
    """Where nests are before anything has moved: base frame, (N, 3), mm."""
    at, turns = np.array(machine.home[:3]), rotation_from_rpy(*machine.home[3:])
    carried = at + np.array(list(around.platform_nests.values())) @ turns.T
    return np.concatenate([carried, list(around.base_nests.values())])


def _smrs(plan: WorldPlan, around: Surroundings) -> Smrs:
    platform, base = around.platform_nests, around.base_nests
    nests = {**dict.fromkeys(platform, "platform"), **dict.fromkeys(base, "base")}
    if plan.smrs == 1:
        places = {"smr1": BIRDBATH}
    elif plan.smrs == len(platform):
        places = {f"smr{i + 1}": nest for i, nest in enumerate(platform)}
    else:
        raise ValueError(f"a station has 1 or {len(platform)} SMRs, not {plan.smrs}")
    fixed = {f"base-{nest}": nest for nest in base} if plan.base_smrs else {}
    return Smrs(nests, {**places, **fixed, "home": BIRDBATH})
