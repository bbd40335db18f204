"""What a session tells its observers: the command line, the screens, the report.

Observers hold no state of the job; whoever joins late reads the journal. Every event is a small
frozen record. Times are machine seconds since the start of the run, positions mm in the frame
that is named, angles rad.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from drivers.interface import Alarm, ControllerState, GaugeState, Identity, TrackerState

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Event:
    """Something happened."""


@dataclass(frozen=True)
class Connected(Event):
    """A device answered; ``role`` is ``controller``, ``tracker`` or ``gauge``."""

    role: str
    identity: Identity
    address: str


@dataclass(frozen=True)
class Disconnected(Event):
    """A device was let go."""

    role: str


@dataclass(frozen=True)
class DeviceStates(Event):
    """A snapshot of both devices, a few times a second; ``None`` where one did not answer."""

    controller: ControllerState | None
    tracker: TrackerState | None
    gauge: GaugeState | None = None


@dataclass(frozen=True)
class AlarmRaised(Event):
    """A device said something unasked, or a check of ours found something to look at."""

    alarm: Alarm
    time_s: float


@dataclass(frozen=True)
class StepStarted(Event):
    """The engine began a step; ``attempt`` counts from 1."""

    step: str
    index: int
    kind: str
    says: str
    attempt: int
    time_s: float


@dataclass(frozen=True)
class StepDone(Event):
    """A step ended well; ``summary`` is one line for the operator."""

    step: str
    index: int
    summary: str
    time_s: float


@dataclass(frozen=True)
class StepFailed(Event):
    """A step did not end well; it stays to be done."""

    step: str
    index: int
    what: str
    time_s: float


@dataclass(frozen=True)
class StepSkipped(Event):
    """A step was left out, and why."""

    step: str
    index: int
    why: str
    time_s: float


@dataclass(frozen=True)
class Progress(Event):
    """How far the plan is; ``remaining_s`` is wall seconds, ``None`` while unknown."""

    done: int
    total: int
    remaining_s: float | None


@dataclass(frozen=True)
class PoseCommanded(Event):
    """The machine was sent to a pose; ``q`` are the controller's own targets."""

    pose_label: str
    pose: tuple[float, ...]
    q: tuple[float, ...]
    time_s: float


@dataclass(frozen=True)
class LivePose(Event):
    """Where the actuators are during a move."""

    q: tuple[float, ...]
    target: tuple[float, ...]
    moving: bool


@dataclass(frozen=True)
class LiveScatter(Event):
    """Scatter of the SMR in the settling window (1 sigma, 3D) against its limit, mm."""

    std_mm: float
    limit_mm: float
    xyz: Vector
    settled: bool


@dataclass(frozen=True)
class ReadingTaken(Event):
    """One dwell was read and is in the journal.

    ``xyz`` and ``predicted`` (from the commanded pose and the base frame found so far) are in the
    tracker frame; ``miss_mm`` is their distance, ``sigma_mm`` the reading's uncertainty (3D).
    """

    number: int
    pose_label: str
    nest: str
    q: tuple[float, ...]
    xyz: Vector
    predicted: Vector
    miss_mm: float
    sigma_mm: float
    time_s: float
    channels: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class NumberTaken(Event):
    """A gauge was read, and the number is in the journal.

    ``value`` and ``expected`` (by the commanded pose, and the zero as found so far) are in
    ``unit``, mm or rad, as is ``sigma``. ``nest2`` is the other end of a distance.
    """

    number: int
    pose_label: str
    nest: str
    nest2: str
    q: tuple[float, ...]
    value: float
    expected: float
    sigma: float
    unit: str
    time_s: float
    channels: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ReadingRejected(Event):
    """A reading was taken and set aside, and why; it stays in the journal."""

    pose_label: str
    nest: str
    why: str
    time_s: float


@dataclass(frozen=True)
class FrameFound(Event):
    """The base frame in the tracker frame: x, y, z, rx, ry, rz, and the fit's RMS, mm."""

    frame: tuple[float, ...]
    rms_mm: float
    nests: tuple[str, ...]


@dataclass(frozen=True)
class DriftChecked(Event):
    """How far the base nests moved since the first reference, at the machine's home, mm."""

    shift_mm: float
    limit_mm: float
    time_s: float


@dataclass(frozen=True)
class PromptNeeded(Event):
    """The operator is asked; answer with :meth:`Session.answer_prompt` (one of ``choices``).

    ``default`` is what an unattended session answers; ``None``: a person must. ``typed`` says what
    may be answered in words of one's own instead of a choice; empty: nothing.
    """

    prompt: str
    text: str
    choices: tuple[str, ...]
    default: str | None
    typed: str = ""


@dataclass(frozen=True)
class PromptAnswered(Event):
    """A prompt was answered, by whoever was first; close its dialog."""

    prompt: str
    answer: str


@dataclass(frozen=True)
class Suspended(Event):
    """The job waits for a condition to pass (beam, environment): why and what to do."""

    why: str
    remedy: str


@dataclass(frozen=True)
class Released(Event):
    """The condition has passed and was checked."""

    why: str


@dataclass(frozen=True)
class Paused(Event):
    """The operator paused; the step in work was ended first."""


@dataclass(frozen=True)
class Resumed(Event):
    """The operator let the job go on."""


@dataclass(frozen=True)
class Stopped(Event):
    """The operator stopped the job; the machine stands still."""

    remedy: str


@dataclass(frozen=True)
class Fault(Event):
    """The job ended on a fault; the machine was brought to a stop. What to do is in ``remedy``."""

    what: str
    remedy: str
    safe: bool


@dataclass(frozen=True)
class Finished(Event):
    """The plan is done and, where it measures a run, exported to ``run_folder``."""

    run_folder: str
    readings: int


@dataclass(frozen=True)
class GateChecked(Event):
    """One safety gate of the write-back: a measured value against its limit."""

    gate: str
    passed: bool
    value: float
    limit: float
    unit: str
    says: str


Stage = Literal[
    "snapshot",
    "compare",
    "gates",
    "disable",
    "write",
    "read-back",
    "verify",
    "confirm",
    "store",
    "reload",
    "done",
    "restore",
    "restored",
    "restore-failed",
]


@dataclass(frozen=True)
class WriteBackStage(Event):
    """Where the write-back is."""

    stage: Stage
    says: str


Observer = Callable[[Event], None]


class Observers:
    """Any number of observers; each is called in the event loop, in the order of joining.

    An observer must return at once. One that raises is a fault of the program and is not hidden.
    """

    def __init__(self) -> None:
        self._observers: list[Observer] = []

    def watch(self, observer: Observer) -> Callable[[], None]:
        """Join; the returned function leaves."""
        self._observers.append(observer)

        def leave() -> None:
            if observer in self._observers:
                self._observers.remove(observer)

        return leave

    def tell(self, event: Event) -> None:
        """Tell every observer."""
        for observer in tuple(self._observers):
            observer(event)
