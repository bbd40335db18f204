"""Reference pages against the readers: every key is on its page, every key of a page is read.

The examples of the pages are read by the real readers, which keep what they asked for.
"""

import csv
import io
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal
from app.files.fits import fit_of
from app.files.machines import load_machine
from app.files.models import write_model
from app.files.poses import pose_file_of, read_any_poses
from app.files.runs import read_run
from app.files.site import site_of
from app.files.staircase import StairStep, Way
from calib.errors import BadInput
from calib.identify import fit
from calib.model import Model
from calib.runs import parse_header, parse_run
from calib.runs.header import header_of
from calib.runs.points import COVARIANCES, KNOWN_CHANNELS, POSITION, SIGMAS
from calib.runs.stack import stack
from calib.toml_table import Asked, TomlTable

DOCS = Path(__file__).parents[2] / "docs"
RUNS = Path(__file__).parents[1] / "data" / "runs"
TOML = r"```toml\n(.*?)```"


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def blocks(name: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page(name), re.DOTALL)


def rows(name: str, first: str) -> list[list[str]]:
    """Rows of the tables of a page whose first column is called ``first``."""
    found, inside = [], False
    for line in page(name).splitlines():
        if not line.startswith("|"):
            inside = False
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] == first:
            inside = True
        elif inside and not set(line) <= set("|-"):
            found.append([cells[0].strip("`"), *cells[1:]])
    assert found, f"{name}.md has no table of {first}s"
    return found


def asked_by(reader, name: str) -> dict[str, Asked]:
    """Keys that a reader asks for in the examples of a page; what only leads to them is no key."""
    asked: dict[str, Asked] = {}
    for number, text in enumerate(blocks(name, "toml")):
        top = TomlTable.parse(text, f"{name}.md, example {number + 1}")
        reader(top)
        asked |= {key: one for key, one in top.asked.items() if key not in asked}
    return {key: one for key, one in asked.items() if one.kind not in ("table", "tables")}


def read_site(top: TomlTable) -> None:
    site_of(top, "docs", DOCS)


def read_poses(top: TomlTable) -> None:
    pose_file_of(top, "docs", load_machine(top.raw("machine") or "hexapod"))


def read_model(top: TomlTable) -> None:
    fit_of(top, "docs")


READERS = {
    "run-format": header_of,
    "model-file": read_model,
    "poses-file": read_poses,
    "site-file": read_site,
}


@pytest.mark.parametrize("name", READERS)
def test_every_key_of_the_reader_is_on_the_page_and_every_key_of_the_page_is_read(name) -> None:
    asked = asked_by(READERS[name], name)
    assert {key for key, *_ in rows(name, "key")} == set(asked)


@pytest.mark.parametrize("name", READERS)
def test_types_units_and_defaults_are_those_of_the_reader(name) -> None:
    asked = asked_by(READERS[name], name)
    for key, kind, unit, default, _ in rows(name, "key"):
        one = asked[key]
        if kind.startswith("numbers"):
            assert re.sub(r"^\d+ ", "", one.kind) == kind, key
        else:
            assert one.kind == kind, key
        if one.unit:
            assert one.unit == unit, key
        if default == "required":
            assert one.required, key
        elif default.startswith("`"):
            value = tomllib.loads(f"value = {default.strip('`')}")["value"]
            assert not one.required, key
            assert np.all(np.equal(value, one.default)), key
        else:
            assert not one.required, key
            assert default != "–" or one.default is None, key


@pytest.mark.parametrize("name", READERS)
def test_a_key_may_be_left_out_where_the_page_says_so(name) -> None:
    """Each line with a key of the example, left out, is read or refused as its row says."""
    required = {key: default == "required" for key, _, _, default, _ in rows(name, "key")}
    text = blocks(name, "toml")[0]
    table, tried = "", 0
    for number, line in enumerate(text.splitlines()):
        if header := re.match(r"\[+([\w.]+)\]+", line):
            table = header.group(1)
        found = re.match(r"(\w+) = ", line)
        path = f"{table}.{found.group(1)}".lstrip(".") if found else ""
        if path not in required or '"""' in line:
            continue
        lines = text.splitlines()
        top = TomlTable.parse("\n".join([*lines[:number], *lines[number + 1 :]]), "docs")
        tried += 1
        if required[path]:
            with pytest.raises(BadInput, match=rf"{re.escape(found.group(1))}.* is missing"):
                READERS[name](top)
        else:
            READERS[name](top)
    assert tried >= 3


def test_model_files_are_written_with_the_keys_of_the_page(tmp_path) -> None:
    loaded = read_run(RUNS / "no-effect")
    path = tmp_path / "model.toml"
    way = Way((StairStep(did="start"),), (("gravity-sag", "leg-compliance"),))
    write_model(path, fit(Model(stack(loaded.machine, [loaded.run]))), way)
    written = tomllib.loads(path.read_text())
    top = {key.split(".")[0] for key, *_ in rows("model-file", "key")}
    assert set(written) == top | {"masked"}
    entry = {key.split(".")[1] for key, *_ in rows("model-file", "key") if "parameters." in key}
    assert set(written["parameters"][0]) == entry | {"nominal"}
    for key in ("runs", "masked", "parameters.nominal"):
        assert f"`{key}`" in page("model-file")


# ------------------------------------------------------------------------------ points.csv


def example() -> tuple[str, str]:
    (header,), (points,) = blocks("run-format", "toml"), blocks("run-format", "csv")
    return header, points


def read_points(cells: list[list[str]]):
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(cells)
    return parse_run(example()[0], text.getvalue(), actuators=3)


def with_every_column() -> list[list[str]]:
    """The example with the columns of the page that it does not have, empty."""
    cells = list(csv.reader(io.StringIO(example()[1])))
    more = [name for name, *_ in rows("run-format", "column") if name not in cells[0]]
    return [cells[0] + more, *[row + [""] * len(more) for row in cells[1:]]]


def test_the_columns_of_the_page_are_those_of_the_reader() -> None:
    optional = [row[0] for row in rows("run-format", "column") if row[1] == "optional"]
    required = [row[0] for row in rows("run-format", "column") if row[1] == "required"]
    assert optional == [*COVARIANCES, *KNOWN_CHANNELS]
    assert required == ["time_s", "pose", "nest", "q1", *POSITION, *SIGMAS]


@pytest.mark.parametrize("row", rows("run-format", "column"), ids=lambda row: row[0])
def test_a_column_and_a_field_may_be_left_out_where_the_page_says_so(row: list[str]) -> None:
    name, there, _, in_a_reading, _ = row
    cells = with_every_column()
    at = cells[0].index(name)
    without = [line[:at] + line[at + 1 :] for line in cells]
    reading = next(k for k, line in enumerate(cells) if k and line[1] and line[2])
    empty = [list(line) for line in cells]
    empty[reading][at] = ""
    for changed, allowed in ((without, there == "optional"), (empty, in_a_reading != "full")):
        if allowed:
            assert read_points(changed).readings == 18
        else:
            with pytest.raises(BadInput, match=name):
                read_points(changed)


def test_the_example_of_the_run_is_fitted(tmp_path, capsys) -> None:
    for name, text in zip(("run.toml", "points.csv"), example(), strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert pkmcal(["fit", str(tmp_path), "--json"]) == 0
    assert '"readings": 18' in capsys.readouterr().out
    assert parse_header(example()[0]).controller_parameters == {"limb1.l0": 410.0}


# ------------------------------------------------------------------------------ poses.csv


def test_the_table_of_poses_is_read_and_has_the_columns_of_the_page(tmp_path) -> None:
    (text,) = blocks("poses-file", "csv")
    path = tmp_path / "poses.csv"
    path.write_text("\ufeff" + text.replace("\n", "\r\n"), encoding="utf-8", newline="")
    assert list(read_any_poses(path, load_machine("hexapod"))) == ["1", "2"]
    assert text.splitlines()[0].split(",") == [row[0] for row in rows("poses-file", "column")]
