"""The page of maps against their reader: every key is there, with its type, unit and default."""

import re
import tomllib
from pathlib import Path

import pytest

from app.files.import_map import map_of
from app.files.shipped_maps import shipped_maps
from calib.toml_table import Asked, TomlTable
from calib.units import UNITS

PAGE = (Path(__file__).parents[2] / "docs" / "import.md").read_text(encoding="utf-8")
BEGIN = 'format = "pkm-import/1"\n[time]\n{time}\n[pose]\ncolumn = 1\n[nest]\ncolumn = 1\n'
MAPS = (
    BEGIN.format(time="column = 1")
    + """
[pose.names]
a = "b"
[nest.names]
a = "b"
[station]
column = 1
[station.names]
a = "b"
[only]
column = 1
[only.names]
a = "b"
[actuators]
columns = "q*"
[[reading]]
kind = "spherical"
columns = [1, 2]
distance = "1 m"
vertical = "zenith"
horizontal = "clockwise"
[sigma]
angle = "1 deg"
distance = "1 mm"
[channels]
a = { column = 1 }
b = { value = 1.0 }
[commands.pose]
column = 1
""",
    BEGIN.format(time="step_s = 1.0")
    + """
[commanded_pose]
rotation = "XYZ"
place = { columns = [1, 2, 3] }
turn = { columns = [1, 2, 3] }
[[reading]]
columns = [1, 2, 3]
[sigma]
value = "1 mm"
""",
    BEGIN.format(time="step_s = 1.0")
    + """
[actuators]
columns = 1
[[reading]]
columns = [1, 2, 3]
[sigma]
columns = [1, 2, 3]
""",
    BEGIN.format(time="step_s = 1.0")
    + """
[actuators]
columns = 1
[[reading]]
kind = "pose"
rotation = "XYZ"
place = { columns = [1, 2, 3] }
turn = { columns = [1, 2, 3] }
[sigma]
place = "1 mm"
turn = "1 deg"
""",
    BEGIN.format(time="step_s = 1.0")
    + """
[actuators]
columns = 1
[[reading]]
kind = "angles"
columns = [1, 2]
vertical = "zenith"
horizontal = "clockwise"
[sigma]
angle = "1 deg"
""",
    BEGIN.format(time="step_s = 1.0")
    + """
[actuators]
columns = 1
[[reading]]
kind = "distance"
columns = [1]
nest2 = "b1"
[sigma]
value = "1 mm"
""",
    BEGIN.format(time="step_s = 1.0")
    + """
[actuators]
columns = 1
[[reading]]
kind = "direction"
value = "1.5 mm"
plane = "bed"
[sigma]
value = "1 mm"
""",
)
SHARED = (
    r"(instruments|planes)\..*|(?!actuators).*\.(unit|sign|gear|scale|offset)|"
    r"commands\.(file\..*|pose\.(?!column).*)"
)
"""Keys that the page names once for all tables."""


def asked() -> dict[str, Asked]:
    found: dict[str, Asked] = {}
    for text in MAPS:
        top = TomlTable.parse(text, "page")
        map_of(top, "page")
        found = {**top.asked, **found}
    return {
        key: one
        for key, one in found.items()
        if one.kind not in ("table", "tables")
        and (not re.fullmatch(SHARED, key) or key == "time.unit")
    }


ASKED = asked()
ROWS = [
    [cell.strip().replace("\\", "") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in PAGE.partition("| key |")[2].partition("\n\n")[0].splitlines()[2:]
]


def test_every_key_of_the_reader_is_on_the_page_and_every_key_of_the_page_is_read() -> None:
    assert {row[0].strip("`") for row in ROWS} == set(ASKED)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].strip("`"))
def test_types_units_and_defaults_are_those_of_the_reader(row: list[str]) -> None:
    key, kind, unit, default, _ = row
    one = ASKED[key.strip("`")]
    assert kind == one.kind or key == "`file.thousands`"
    assert unit == one.unit
    assert (default == "required") == one.required
    if default.startswith("`"):
        assert tomllib.loads(f"value = {default.strip('`')}")["value"] == one.default
    elif default == "–":
        assert one.default is None


def test_units_and_maps_of_the_page_are_those_of_the_program() -> None:
    for name in shipped_maps():
        assert f"| `{name}` |" in PAGE
    known = re.search(r"Known are\n(.*?)\.\n", PAGE, re.DOTALL)
    assert known is not None
    named = set(re.findall(r"[\w^]+", known[1]))
    assert named == {name for name in UNITS if "^" not in name and name != "1"}
