"""What has been made to go wrong in a station: names, shared by all servers and threads.

Names, with what reads them:

======================================  ==========================================================
``drive-fault:N``                       drive of leg N goes to fault and stays there
``runs-away:N``                         drive N of a bare machine moves away from its targets
``leaves-mode:N``                       one-shot: drive N of a bare machine goes to mode 1, as if a
                                        panel or another program had told it so
``sync-lost:N``                         drive N of a bare machine hears no SYNC
``heartbeat-silent:N``                  node N stops its heartbeat and answers nothing
``parameter-corrupt:NAME``              the controller answers another value for parameter NAME
``parameter-missing:NAME``              the controller does not know parameter NAME
``parameter-nan:NAME``                  the controller answers NaN for parameter NAME
``write-refused:NAME``                  the controller refuses to write parameter NAME
``write-lost:NAME``                     the controller acknowledges NAME and does not keep it
``reference-lost:N``                    one-shot: drive N forgets that it was homed
``write-refused:NAME``                  the controller refuses to take parameter NAME
``write-lost:NAME``                     the controller acknowledges NAME and keeps the old value
``reference-lost:N``                    one-shot: drive N forgets where its reference is
``store-refused``                       the controller refuses to store its parameters
``controller-silent``                   a GCS controller reads nothing and answers nothing
``controller-garbage``                  every answer of a GCS controller is garbage
``controller-half-line``                one-shot: an answer of a GCS controller breaks off
``power-cycle``                         one-shot: the controller and the drives lose their volatile
                                        memory and boot again
``tracker-not-initialised``             one-shot: the tracker forgets that it was initialised
``tracker-cold``                        the laser is heating; measurements answer NotWarmedUp
``tracker-unstable``                    measurements answer NotStable
``tracker-no-object-sensor``            no sensor of the object's temperature is connected
``tracker-no-weather-station``          no weather station is connected
``tracker-lost``                        a tracker that sends lines has lost its SMR
``tracker-silent``                      the tracker answers nothing
``tracker-no-result``                   StartMeasurement is answered, the result never comes
``tracker-result-unstable``             the result comes with status NoStationaryResult
``tracker-unsolicited-error``           one-shot: an Error packet with command Unknown
``gauge-silent``                        the gauge answers nothing: its battery
``gauge-held``                          the gauge answers its last number again and again
``gauge-dead``                          a touch probe never says that it touches
``gauge-over``                          the gauge is out of its range
``gauge-noise``                         every other line of the gauge is garbage
``gauge-inch``                          somebody has switched the gauge to inches; its lines say so
``gauge-inch-untold``                   the same, and its lines have no unit
``gauge-reversed``                      the gauge counts the other way
``jammed``                              set by the machine itself: the legs could not close
``misplace:NEST``                       one-shot: the next SMR carried ends in NEST instead
======================================  ==========================================================
"""

import threading
from collections.abc import Callable, Iterator


class FaultSet:
    """A thread-safe set of names of injected faults, with listeners."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._names: set[str] = set()
        self._listeners: list[Callable[[str, bool], None]] = []

    def subscribe(self, listener: Callable[[str, bool], None]) -> None:
        """Call ``listener(name, present)`` after each change, in the thread that made it."""
        with self._lock:
            self._listeners.append(listener)

    def inject(self, name: str) -> None:
        """Make ``name`` go wrong from now on."""
        with self._lock:
            new = name not in self._names
            self._names.add(name)
            listeners = list(self._listeners)
        if new:
            for listener in listeners:
                listener(name, True)

    def clear(self, name: str) -> bool:
        """End ``name``; returns whether it was there."""
        with self._lock:
            present = name in self._names
            self._names.discard(name)
            listeners = list(self._listeners)
        if present:
            for listener in listeners:
                listener(name, False)
        return present

    def clear_all(self) -> None:
        """End everything."""
        for name in self.snapshot():
            self.clear(name)

    def take(self, name: str) -> bool:
        """Consume a one-shot fault: True, once, if it was there."""
        return self.clear(name)

    def arguments(self, kind: str) -> frozenset[str]:
        """The parts after the colon of all faults ``kind:...``."""
        prefix = kind + ":"
        return frozenset(n[len(prefix) :] for n in self.snapshot() if n.startswith(prefix))

    def snapshot(self) -> frozenset[str]:
        """All names at this moment."""
        with self._lock:
            return frozenset(self._names)

    def __contains__(self, name: object) -> bool:
        with self._lock:
            return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self.snapshot())
