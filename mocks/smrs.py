"""The SMRs of a station and where they are: in a nest, in the birdbath, or in a hand."""

import threading
from collections.abc import Callable, Mapping

BIRDBATH = "birdbath"
HAND = "hand"


class Smrs:
    """Which SMR is where, and by how much its centre is off. Thread-safe.

    Parameters
    ----------
    nests : mapping
        Names of all nests, with their carriers "platform" or "base".
    places : mapping
        SMR name -> nest, :data:`BIRDBATH` or :data:`HAND`.
    """

    def __init__(self, nests: Mapping[str, str], places: Mapping[str, str]) -> None:
        self.nests = dict(nests)
        self._lock = threading.Lock()
        self._places = dict(places)
        self._off: dict[str, float] = dict.fromkeys(places, 0.0)
        self._listeners: list[Callable[[str], None]] = []

    def subscribe(self, listener: Callable[[str], None]) -> None:
        """Call ``listener(smr)`` after an SMR has changed its place."""
        self._listeners.append(listener)

    @property
    def places(self) -> dict[str, str]:
        """Where each SMR is."""
        with self._lock:
            return dict(self._places)

    def centre_off_mm(self, smr: str) -> float:
        """How far the SMR's centre stands above its nominal place along the nest's z, mm."""
        with self._lock:
            return self._off.get(smr, 0.0)

    def put(self, smr: str, place: str) -> None:
        """Put an SMR into a free place; raises ValueError if that is impossible."""
        with self._lock:
            self._must_know(smr)
            if place not in (*self.nests, BIRDBATH, HAND):
                raise ValueError(f'there is no nest "{place}"; nests: {", ".join(self.nests)}')
            holder = [s for s, p in self._places.items() if p == place and s != smr]
            if holder and place in self.nests:
                raise ValueError(f"nest {place} already holds {holder[0]}")
            self._places[smr] = place
        for listener in self._listeners:
            listener(smr)

    def swap_for_other(self, smr: str, off_mm: float) -> None:
        """Exchange an SMR for one whose centre stands ``off_mm`` higher (another diameter)."""
        with self._lock:
            self._must_know(smr)
            self._off[smr] = off_mm

    def exchange(self, first: str, second: str) -> None:
        """Exchange the places of two SMRs."""
        with self._lock:
            self._must_know(first)
            self._must_know(second)
            places = self._places
            places[first], places[second] = places[second], places[first]
        for listener in self._listeners:
            listener(first)
            listener(second)

    def in_nest(self, nest: str) -> str | None:
        """The SMR in a nest, if any."""
        return next((smr for smr, place in self.places.items() if place == nest), None)

    def _must_know(self, smr: str) -> None:
        if smr not in self._places:
            raise ValueError(f'there is no SMR "{smr}"; SMRs: {", ".join(self._places)}')
