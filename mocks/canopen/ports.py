"""What the CANopen nodes ask of the machine behind them: :class:`mocks.world.World` has it."""

from collections.abc import Callable, Sequence
from typing import Protocol

from mocks.physics.circumstances import Stroke


class Leg(Protocol):
    """One leg's motion: extension in mm of the encoder, 0 at home."""

    def command(self, target_extension_mm: float, duration_s: float) -> None:
        """Move to a target in ``duration_s`` of machine time."""

    def stop(self) -> None:
        """Brake at once."""

    def position(self) -> float:
        """Extension now."""

    @property
    def target(self) -> float:
        """Extension commanded last."""

    @property
    def moving(self) -> bool:
        """Whether it is under way."""

    @property
    def stalled(self) -> bool:
        """Whether it is jammed."""


class MachineClock(Protocol):
    """Machine time."""

    @property
    def scale(self) -> float:
        """Machine seconds per wall second."""

    def now(self) -> float:
        """Machine seconds."""


class Faults(Protocol):
    """Names of what has been made to go wrong; the names are listed in ``mocks/faults.py``."""

    def subscribe(self, listener: Callable[[str, bool], None]) -> None:
        """Call ``listener(name, present)`` after each change."""

    def take(self, name: str) -> bool:
        """Consume a one-shot fault."""

    def arguments(self, kind: str) -> frozenset[str]:
        """The parts after the colon of all faults ``kind:...``."""

    def __contains__(self, name: object) -> bool: ...


class Machine(Protocol):
    """The machine as its electronics see it."""

    @property
    def kind(self) -> str:
        """Name of the machine file."""

    @property
    def unit(self) -> str:
        """Unit of the actuators: mm or rad."""

    @property
    def stroke(self) -> Stroke:
        """How large a move is, in the actuators' unit."""

    @property
    def clock(self) -> MachineClock:
        """Machine time."""

    @property
    def legs(self) -> Sequence[Leg]:
        """All legs, in the order of the actuators."""

    @property
    def faults(self) -> Faults:
        """Injected faults."""

    @property
    def payload_kg(self) -> float:
        """Mass of the payload, kg."""

    def structure_temp_C(self) -> float:  # noqa: N802 (the unit's own capital)
        """Temperature of the structure, deg C."""
