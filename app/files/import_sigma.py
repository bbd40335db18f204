"""How uncertain a reading is, as a map states it."""

from dataclasses import dataclass

from app.files.import_columns import Numbers, numbers_of
from calib.toml_table import TomlTable

NUMBERS = {"height": "mm", "direction": "mm", "distance": "mm", "tilt": "rad"}
"""Kinds of which a column holds one number, with its unit."""


@dataclass(frozen=True)
class Sigma:
    """Uncertainty of a reading, 1 sigma: columns, or what the map states (mm, rad, mm/mm)."""

    numbers: Numbers | None
    coverage: float = 1.0
    value: float | None = None
    per_distance: float = 0.0
    angle: float | None = None
    distance: float | None = None
    place: str = ""
    sky: bool = False
    """The angle is that of a direction: the azimuth's is larger by 1 / cos(elevation)."""


def _sigma_of_number(table: TomlTable, unit: str, coverage: float) -> Sigma:
    """A column, or one for all."""
    if table.has("columns"):
        found = Sigma(numbers_of(table, 1, (unit,)), coverage, place=table.place())
    else:
        found = Sigma(None, coverage, table.quantity("value", unit, 0.0), place=table.place())
        if not found.value or found.value < 0.0:
            raise table.wrong(
                "nothing says how uncertain a number is", "value",
                remedy='Write columns = ["sigma"] with a unit, or value = "5 um" ("0.01 deg")',
            )  # fmt: skip
    table.end()
    return found


def sigma_of(table: TomlTable, kind: str) -> Sigma:
    """What a reading's uncertainty is; raises BadInput where nothing states it."""
    coverage = table.number("coverage", 1.0, above=0.0)
    place = table.place()
    if kind in NUMBERS:
        return _sigma_of_number(table, NUMBERS[kind], coverage)
    if kind == "pose":
        value = table.quantity("place", "mm", 0.0, least=0.0)
        turn = table.quantity("turn", "rad", 0.0, least=0.0)
        if value <= 0.0 or turn <= 0.0:
            raise table.wrong(
                "place and attitude need an uncertainty each", "place",
                remedy='Write place = "20 um" and turn = "0.002 deg"',
            )  # fmt: skip
        table.end()
        return Sigma(None, coverage, value, 0.0, turn, None, place)
    if kind == "angles":
        angle = table.quantity("angle", "rad", 0.0, least=0.0)
        if angle <= 0.0:
            raise table.wrong(
                "directions need an uncertainty", "angle", remedy='Write angle = "0.0003 deg"'
            )
        sky = table.flag("sky", False)
        table.end()
        return Sigma(None, coverage, None, 0.0, angle, None, place, sky)
    if kind == "spherical":
        angle = table.quantity("angle", "rad", 0.0, least=0.0)
        distance = table.quantity("distance", "mm", 0.0, least=0.0)
        if angle <= 0.0 or distance <= 0.0:
            raise table.wrong(
                "angle and distance need an uncertainty each", "angle",
                remedy='Write angle = "0.0003 deg" and distance = "0.01 mm"',
            )  # fmt: skip
        per = 1e-6 * table.number("ppm", 0.0, least=0.0)
        table.end()
        return Sigma(None, coverage, None, per, angle, distance, place)
    if table.has("columns"):
        numbers = numbers_of(table, 3, ("mm",))
        table.end()
        return Sigma(numbers, coverage, place=place)
    value = table.quantity("value", "mm", 0.0, least=0.0)
    if value <= 0.0:
        raise table.wrong(
            "nothing says how uncertain a reading is", "value",
            remedy='Write columns = ["sx", "sy", "sz"] with a unit, or value = "15 um"',
        )  # fmt: skip
    per = 1e-6 * table.number("ppm", 0.0, least=0.0)
    table.end()
    return Sigma(None, coverage, value, per, place=place)
