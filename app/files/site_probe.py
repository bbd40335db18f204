"""``[gauge]`` of a probe that only says whether it touches: how it is brought to a surface."""

from dataclasses import dataclass

from calib.toml_table import TomlTable

STEP_MM, FINE_MM, RADIUS_MM = 0.5, 0.01, 0.0
TENTH = 0.1
NUMBERS = ("zero_at", "sign", "lowest", "highest", "axis")
"""Keys of what shows a number."""


@dataclass(frozen=True)
class Search:
    """Steps in which a probe goes to a surface, mm.

    ``step_mm`` until it touches first; then lifted, and again in tenths of that, down to
    ``fine_mm``, in which the contact is latched. ``below_mm`` is how far it goes beyond where the
    drawing has the surface; ``radius_mm`` that of its ball.
    """

    step_mm: float
    fine_mm: float
    below_mm: float
    radius_mm: float

    @property
    def steps(self) -> tuple[float, ...]:
        """The steps of one search after the other, the finest last."""
        found = [self.step_mm]
        while found[-1] > self.fine_mm:
            found.append(max(TENTH * found[-1], self.fine_mm))
        return tuple(found)

    @property
    def spread_mm(self) -> float:
        """Standard uncertainty that the finest step leaves: anywhere within it."""
        return self.fine_mm / float(12.0**0.5)


def read_search(table: TomlTable, reads: str, plane: str, near: float) -> Search:
    """Check the keys of a probe that tells contacts; ``near`` is how far the surface may be off."""
    if reads != "direction":
        table.complain(
            f"a contact is no {reads}", "reads", remedy='Write reads = "direction" and a plane'
        )
    elif not plane:
        table.complain(
            "a contact needs a plane that is touched", "reads",
            remedy='Add plane = "plate" and [planes.plate] with normal and through',
        )  # fmt: skip
    for key in NUMBERS:
        if table.has(key):
            table.complain(
                f"it shows no number, {key} says nothing of it", key, remedy=f"Leave {key} out"
            )
            table.raw(key)
    step = table.number("step_mm", STEP_MM, unit="mm", above=0.0)
    fine = table.number("fine_mm", min(FINE_MM, step), unit="mm", above=0.0)
    if fine > step:
        table.complain(
            f"fine_mm is {fine:g}, step_mm {step:g}", "fine_mm",
            remedy="The steps that latch a contact are the smaller ones",
        )  # fmt: skip
    return Search(
        step_mm=step, fine_mm=fine,
        below_mm=table.number("below_mm", near, unit="mm", above=0.0),
        radius_mm=table.number("radius_mm", RADIUS_MM, unit="mm", least=0.0),
    )  # fmt: skip
