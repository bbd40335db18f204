"""The readings of one or several runs of a machine, stacked for the model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray, Selection
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs.commanded import CommandedPath, joined_paths
from calib.runs.record import Run, holdout_folds
from calib.runs.remark import Remark
from calib.runs.sensed import BASE, Blocks, FrameOf, Sensed, blocks_of, sensed
from calib.runs.sensing import POINT, POSE

STATES = ("q", "extension", "direction", "step", "time_s", "progress", "run", "path")
"""State columns that every reading has; all others are channels."""
_ARRAYS = (
    "run", "line", "extension", "q", "at", "time_s", "progress", "position", "covariance", "nest",
    "on_platform", "fold",
)  # fmt: skip
VAGUE = 100.0
"""Times the usual best sigma of its run from which a component tells nothing in mm."""


@dataclass(frozen=True, eq=False)
class Rows:
    """N readings of K runs; rows without a reading are on the ``path`` that led to them.

    Attributes
    ----------
    run, line : (N,)
        Run index 0..K-1, and line in that run's ``points.csv``.
    extension, q : (n, N)
        Commanded extension s by the controller's own parameters, and coordinate q.
    path, at : CommandedPath, (N,)
        Where the actuators went, row by row from the start of each run, and the row on it of each
        reading: all that a reading may remember.
    time_s, progress : (N,)
        Seconds from the start of the run, and the same as 0..1 over the run.
    position, covariance : (3, N), (3, 3, N)
        What the tracker read, mm, tracker frame.
    nest : (3, N)
        SMR centre where it was put: platform frame if ``on_platform``, else base frame, mm.
    fold : (N,)
        Hold-out fold of whole poses, -1 for reference readings.
    channels : dict of (N,)
        State readings; nan where a run has none.
    remarks : tuple of Remark
        What is wrong with the record itself, and what was done about it (calib.look).
    known : mapping of str to (U,)
        Effects that the record itself shows, with values near which they are found.
    sensed : Sensed, optional
        What the readings measure, where they are not all points of one tracker a run: a reading is
        then a block of up to three components, in ``position``.
    """

    machine: Machine
    runs: tuple[Run, ...]
    run: IntArray
    line: IntArray
    pose_name: tuple[str, ...]
    nest_name: tuple[str, ...]
    extension: Array
    q: Array
    path: CommandedPath
    at: IntArray
    time_s: Array
    progress: Array
    position: Array
    covariance: Array
    nest: Array
    on_platform: BoolArray
    fold: IntArray
    channels: dict[str, Array]
    remarks: tuple[Remark, ...] = ()
    known: Mapping[str, Array] = field(default_factory=dict)
    sensed: Sensed | None = None

    @property
    def count(self) -> int:
        """Number of readings N."""
        return self.run.size

    @cached_property
    def direction(self) -> Array:
        """Sign (n, N) of each actuator's last change; 0 before the first."""
        return self.path.direction[:, self.at]

    @cached_property
    def step(self) -> Array:
        """Last change (n, N) of each actuator itself, with its sign; 0 before the first."""
        return self.path.step[:, self.at]

    @cached_property
    def moment(self) -> Array:
        """Time (N,) in s of each reading; those of one time one after the other, as in the file."""
        return self.path.moment[self.at]

    def take(self, which: Selection) -> "Rows":
        """Readings selected by index, slice or mask; what led to each stays as it was."""
        chosen = np.arange(self.count)[which]
        return replace(
            self,
            pose_name=tuple(self.pose_name[row] for row in chosen),
            nest_name=tuple(self.nest_name[row] for row in chosen),
            channels={name: values[chosen] for name, values in self.channels.items()},
            sensed=None if self.sensed is None else self.sensed.take(chosen),
            **{name: getattr(self, name)[..., chosen] for name in _ARRAYS},
        )

    @cached_property
    def unwhitener(self) -> Array:
        """Cholesky factors (3, 3, N) of the covariance, mm: residual = unwhitener @ whitened."""
        if self.sensed is not None:
            return self.sensed.root
        factors = np.linalg.cholesky(np.moveaxis(self.covariance, -1, 0))
        return np.asarray(np.moveaxis(factors, 0, -1), dtype=np.float64, order="C")

    @cached_property
    def whitener(self) -> Array:
        """Inverses (3, 3, N) of ``unwhitener``: whitened residual = whitener @ residual.

        Zero for components that a reading does not hold.
        """
        if self.sensed is not None:
            return self.sensed.whitener
        inverse = np.linalg.inv(np.moveaxis(self.unwhitener, -1, 0))
        return np.asarray(np.moveaxis(inverse, 0, -1), dtype=np.float64)

    @cached_property
    def live(self) -> BoolArray:
        """Components (3, N) that the readings hold."""
        if self.sensed is None:
            return np.ones((3, self.count), dtype=bool)
        return self.sensed.seen

    def folded(self, columns: Array) -> Array:
        """Whitened columns (..., N) of the readings, the other ends of distances taken in."""
        return columns if self.sensed is None else self.sensed.fold(columns)

    @cached_property
    def components(self) -> IntArray:
        """Number (N,) of components that each reading holds."""
        return np.asarray(self.live.sum(axis=0), dtype=np.intp)

    @cached_property
    def placed(self) -> BoolArray:
        """Readings (N,) that say where an SMR or a target is, in all three directions."""
        if self.sensed is None:
            return np.ones(self.count, dtype=bool)
        pointed = np.isin(self.sensed.kind, (POINT, POSE)) & ~self.sensed.turn
        return np.asarray(pointed & np.all(self.in_millimetres, axis=0))

    @cached_property
    def optical(self) -> BoolArray:
        """Readings (N,) of an instrument in a frame of its own, whose errors are a tracker's."""
        return np.asarray(self.frame != BASE)

    @cached_property
    def in_millimetres(self) -> BoolArray:
        """Components (3, N) that say something in mm.

        They are held, a length, and not a hundred times vaguer than the best of their run are.
        """
        lengths = self.live.copy()
        if self.sensed is not None:
            lengths &= ~self.sensed.angular
        variance = np.einsum("iin->in", self.covariance)
        own = np.where(lengths, variance, np.inf)
        for run in np.unique(self.run):
            here = self.run == run
            # Nests on the base may be next to exact: they make nothing else vague.
            judging = here & self.on_platform if np.any(here & self.on_platform) else here
            least = np.min(own[:, judging], axis=0)
            least = least[np.isfinite(least)]
            if least.size:
                lengths[:, here] &= own[:, here] <= VAGUE**2 * np.median(least)
        return np.asarray(lengths)

    @cached_property
    def frame(self) -> IntArray:
        """Which base frame (N,) each reading is seen in: one a run, or of ``frames``."""
        return self.run if self.sensed is None else self.sensed.frame

    @property
    def ghost(self) -> BoolArray:
        """Rows (N,) that are no readings: the second marks of distances between two poses."""
        return np.zeros(self.count, dtype=bool) if self.sensed is None else self.sensed.ghost

    @cached_property
    def frames(self) -> tuple[FrameOf, ...]:
        """Base frames to be found: one for each instrument of a run with a frame of its own."""
        if self.sensed is None:
            return tuple(FrameOf(run, "", None) for run in range(len(self.runs)))
        return self.sensed.frames

    def in_mm(self, whitened: Array, which: Selection = slice(None)) -> Array:
        """Displacements (..., 3, M) in sigmas of the readings ``which``, in mm.

        Zero for components that say nothing in mm.
        """
        factors = self.unwhitener[:, :, which]
        moved = np.asarray(np.einsum("ijn,...jn->...in", factors, whitened))
        told = self.in_millimetres[:, which]
        return moved if told.all() else moved * told

    def has(self, name: str) -> bool:
        """Whether there is a state column of that name."""
        return name in STATES or name in self.channels

    def column(self, name: str) -> Array:
        """State columns (k, N) by name: one of ``STATES`` or a channel.

        ``path`` numbers the stops of the path: readings with one number have one past.
        """
        if name == "path":
            return self.path.stop[self.at][None].astype(np.float64)
        values = getattr(self, name) if name in STATES else self.channels[name]
        return np.atleast_2d(np.asarray(values, dtype=np.float64))

    def sort(self, row: int) -> tuple[object, ...]:
        """What a reading measures, beside its nest: only the same are repeats of one another."""
        if self.sensed is None:
            return ()
        own = self.sensed
        return (
            int(own.kind[row]), int(own.frame[row]), bool(own.turn[row]), own.second_name[row],
            int(own.plane[row]), own.axis[:, row].tobytes(), own.seen[:, row].tobytes(),
        )  # fmt: skip

    def place(self, row: int) -> str:
        """Where a reading stands, for messages."""
        return f"{self.runs[self.run[row]].source}, line {self.line[row]}"


def stack(machine: Machine, runs: Sequence[Run]) -> Rows:
    """Stack the readings of ``runs`` (in order, each with its own frame and drift).

    Raises
    ------
    BadInput
        For a controller parameter that the machine does not have.
    """
    if not runs:
        raise BadInput("no run is given", remedy="Name at least one run's folder")
    blocks = [blocks_of(run) for run in runs]
    parts = [
        _part(machine, run, index, own)
        for index, (run, own) in enumerate(zip(runs, blocks, strict=True))
    ]
    starts = np.cumsum([0, *(part.path.count for part in parts)])
    names = dict.fromkeys(name for run in runs for name in run.channels)
    return Rows(
        machine=machine,
        runs=tuple(runs),
        pose_name=tuple(name for part in parts for name in part.pose_name),
        nest_name=tuple(name for part in parts for name in part.nest_name),
        channels={
            name: np.concatenate(
                [part.channels.get(name, np.full(part.count, np.nan)) for part in parts]
            )
            for name in names
        },
        path=joined_paths([part.path for part in parts]),
        remarks=(),
        known={},
        sensed=sensed(runs, blocks),
        at=np.concatenate(
            [part.at + start for part, start in zip(parts, starts[:-1], strict=True)]
        ),
        **{
            field: np.concatenate([getattr(part, field) for part in parts], axis=-1)
            for field in _ARRAYS
            if field != "at"
        },
    )


def _part(machine: Machine, run: Run, index: int, blocks: Blocks) -> Rows:
    """One run's readings, on the path of all its rows."""
    rows, stood = blocks.rows, blocks.stood
    extension = machine.extension(run.q, run.header.controller_parameters)
    motion = np.array([axis.motion for axis in machine.axes])
    nests = {**run.header.platform_nests, **run.header.base_nests}
    span = float(np.ptp(run.time_s))
    progress = (run.time_s - run.time_s[0]) / span if span > 0 else np.zeros_like(run.time_s)
    return Rows(
        machine=machine,
        runs=(run,),
        run=np.full(rows.size, index, dtype=np.intp),
        line=run.line[rows].astype(np.intp),
        pose_name=tuple(run.pose[row] for row in rows),
        nest_name=blocks.nest,
        extension=extension[:, stood],
        q=run.q[:, stood],
        path=CommandedPath.of_run(extension, run.time_s, motion),
        at=stood.astype(np.intp),
        time_s=run.time_s[stood],
        progress=progress[stood],
        position=run.position[:, rows],
        covariance=run.covariance[:, :, rows],
        nest=np.array([nests[name] for name in blocks.nest]).T,
        on_platform=_moving(run, rows),
        fold=holdout_folds(run)[rows].astype(np.intp),
        channels={name: values[stood] for name, values in run.channels.items()},
    )


def _moving(run: Run, rows: IntArray) -> BoolArray:
    """Readings (N,) that move with the platform: not those between two nests on it."""
    nests = run.header.platform_nests
    on = np.array([run.nest[row] in nests for row in rows], dtype=bool)
    if run.sensing is not None:
        other = np.array([run.sensing.second[row] in nests for row in rows], dtype=bool)
        on ^= other & (run.sensing.ends[0, rows] < 0)
    return on
