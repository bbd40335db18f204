"""A screw's error is no sine: beside once per turn it has a wave of two, three or four a turn.

    extension_i = A_i sin(2 pi s_i / p) + B_i cos(2 pi s_i / p),   p a half to a quarter of a turn

The turn is the period of ``screw-cyclic``, beside which alone this is asked: a second wave of any
period would be as dear to look for as the first, and two of one kind could pass for each other.
"""

from collections.abc import Iterator, Mapping

from calib.arrays import Array
from calib.effects.screw_cyclic import ScrewCyclic
from calib.mechanism.description import Machine
from calib.runs.stack import Rows

ORDERS = (2, 3, 4)


class ScrewHarmonic(ScrewCyclic):
    """A sine and a cosine for each actuator of one unit, and one period for all of them."""

    id = "screw-harmonic"
    says = "the error of each screw within a turn is no sine: two, three or four waves a turn"
    beside = ("screw-cyclic",)

    def given_period(self, machine: Machine) -> float | None:
        """Not stated."""
        return None

    def trials_beside(self, rows: Rows, held: Mapping[str, Array]) -> Iterator[tuple[float, ...]]:
        """Parts of the turn that was found, or that the machine file states."""
        if "screw-cyclic" not in held:
            yield from self.trials(rows)
            return
        turn = ScrewCyclic().given_period(rows.machine) or abs(float(held["screw-cyclic"][-1]))
        for order in ORDERS:
            yield (turn / order,)


EFFECTS = (ScrewHarmonic(),)
