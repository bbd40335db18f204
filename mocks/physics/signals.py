"""Quantities as functions of machine time: random wander and steps made by people."""

import threading

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Wander:
    """Stationary random signals with exponential correlation, as a sum of sinusoids.

    The autocovariance is sigma^2 exp(-|dt| / tau) on average; any instant may be asked for, in
    any order, by any thread. ``channels`` independent signals.
    """

    def __init__(
        self, rng: np.random.Generator, tau_s: float, channels: int, terms: int = 96
    ) -> None:
        # Lorentzian spectrum, stratified so that few terms represent it well.
        strata = (np.arange(terms) + rng.random((channels, terms))) / terms
        self._omega = np.tan(0.5 * np.pi * np.minimum(strata, 0.995)) / tau_s
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (channels, terms))
        self._gain = np.sqrt(2.0 / terms)

    def at(self, times: Array) -> Array:
        """Unit-variance signals at ``times`` (N,): (channels, N)."""
        angle = self._omega[:, :, None] * times + self._phase[:, :, None]
        return np.asarray(self._gain * np.cos(angle).sum(axis=1))

    def mean(self, start: float, end: float) -> Array:
        """Exact means of the signals between two instants, (channels,)."""
        half = 0.5 * (end - start)
        middle = 0.5 * (start + end)
        x = self._omega * half
        fade = np.sinc(x / np.pi)
        angle = self._omega * middle + self._phase
        return np.asarray(self._gain * (fade * np.cos(angle)).sum(axis=1))


def mean_variance(duration: float, tau: float) -> float:
    """Variance of the mean over ``duration`` of a unit signal with correlation time ``tau``."""
    if duration <= 0.0:
        return 1.0
    x = duration / tau
    return float(2.0 / x * (1.0 - (1.0 - np.exp(-x)) / x))


class Steps:
    """A quantity that people change now and then: constant between the changes."""

    def __init__(self, value: Array) -> None:
        self._lock = threading.Lock()
        self._times = [-np.inf]
        self._values = [np.asarray(value, dtype=float)]

    def set(self, time: float, value: Array) -> None:
        """From ``time`` on the quantity is ``value``."""
        with self._lock:
            self._times.append(max(time, self._times[-1]))
            self._values.append(np.asarray(value, dtype=float))

    def at(self, times: Array) -> Array:
        """Values at ``times`` (N,): (N, ...)."""
        with self._lock:
            starts, values = np.array(self._times), np.array(self._values)
        return np.asarray(values[np.searchsorted(starts, times, side="right") - 1])

    @property
    def last(self) -> Array:
        """The value that was set last."""
        with self._lock:
            return self._values[-1]
