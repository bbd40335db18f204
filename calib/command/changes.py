"""What the effects of an identified machine change, all together."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.command.identified import Identified
from calib.effects.component import Signature, Situation

AGREED = 1e-10
"""Change from pass to pass, as a part of the machine's size (rad of turns), that is rounding."""


@dataclass(frozen=True, eq=False)
class Changes:
    """Changes at N commands by all effects together.

    Attributes
    ----------
    extension : (n, N)
        Of the extensions, mm or rad.
    parameters : (P, N) or None
        Of the machine's parameters, mm or rad.
    twist : (6, N) or None
        Of the platform itself, mm and rad, base axes.
    signatures : tuple of Signature
        Derivatives by the unknowns of every effect, in their order.
    """

    extension: Array
    parameters: Array | None
    twist: Array | None
    signatures: tuple[Signature, ...] = ()

    @property
    def count(self) -> int:
        """Number of commands N."""
        return int(self.extension.shape[1])

    def at(self, k: int) -> "Changes":
        """Those of one command."""
        if self.count == 1:
            return self
        own = slice(k, k + 1)
        return Changes(
            self.extension[:, own],
            None if self.parameters is None else self.parameters[:, own],
            None if self.twist is None else self.twist[:, own],
        )

    def last(self, count: int) -> "Changes":
        """Those of the last command, for ``count`` others nearby."""

        def spread(values: Array) -> Array:
            return np.repeat(values[:, -1:], count, axis=1)

        return Changes(
            spread(self.extension),
            None if self.parameters is None else spread(self.parameters),
            None if self.twist is None else spread(self.twist),
        )

    def growing(self, extension: Array) -> "Changes":
        """The same if the effects change the extensions by (n, N) more."""
        return replace(self, extension=self.extension + extension)


def changes_at(identified: Identified, situation: Situation) -> Changes:
    """Sum of what every effect does there; nan where a formula has no value."""
    signatures = tuple(
        found.effect.signature(situation, found.values) for found in identified.effects
    )
    extension: Array | None = None
    parameters: Array | None = None
    twist: Array | None = None
    for found, own in zip(identified.effects, signatures, strict=True):
        if own.extension is not None:
            extension = _more(extension, found.amplitudes, own.extension)
        if own.parameters is not None:
            parameters = _more(parameters, found.amplitudes, own.parameters)
        if own.twist is not None:
            twist = _more(twist, found.amplitudes, own.twist)
    if extension is None:
        extension = np.zeros_like(situation.rows.extension)
    return Changes(extension, parameters, twist, signatures)


def _more(total: Array | None, amplitudes: Array, columns: Array) -> Array:
    """``total`` (c, N) and what columns (U, c, N) add to it."""
    unknowns, components, count = columns.shape
    added = amplitudes @ columns.reshape(unknowns, components * count)
    own: Array = added.reshape(components, count)
    return own if total is None else total + own


def unrest(identified: Identified, now: Changes, before: Changes | None) -> Array:
    """Largest change between two passes (N,): lengths by the machine's size, turns in rad."""
    count = now.extension.shape[1]
    if before is None:
        return np.full(count, np.inf if identified.effects else 0.0)
    extension, parameters = identified.lengths
    largest = (np.abs(now.extension - before.extension) / extension).max(axis=0)
    for one, other, length in (
        (now.twist, before.twist, identified.twist_lengths),
        (now.parameters, before.parameters, parameters),
    ):
        if one is not None:
            moved = one if other is None else one - other
            largest = np.maximum(largest, (np.abs(moved) / length).max(axis=0))
    return np.asarray(largest)
