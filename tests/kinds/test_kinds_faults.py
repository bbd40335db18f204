"""What is wrong in a run of version 2 is said with line, column and remedy."""

import csv
import io

import pytest
import tomli_w

from app.cli import run as pkmcal
from calib.errors import BadInput
from calib.runs import parse_run
from calib.runs.stack import stack
from tests.kinds.conftest import everything
from tests.mechanism.conftest import load


@pytest.fixture(scope="module")
def texts():
    return everything(load("delta"), seed=2, poses=4, share=0.2).texts()


def line_of(cells, kind: str, only=lambda row: True) -> int:
    return next(k for k, row in enumerate(cells) if row["kind"] == kind and only(row))


def changed(texts, of: str, only=lambda row: True, **values: str) -> tuple[tuple[str, str], int]:
    """The same run with other fields in the first row of a kind, and its line."""
    reader = csv.DictReader(io.StringIO(texts[1]))
    cells, names = list(reader), list(reader.fieldnames)
    row = line_of(cells, of, only)
    cells[row] |= values
    names += [name for name in values if name not in names]
    out = io.StringIO()
    writer = csv.DictWriter(out, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(cells)
    return (texts[0], out.getvalue()), row + 2


CASES = {
    "zero sigma of a point": ("point", {"sx": "0"}, "larger than zero"),
    "no sigma of a point": ("point", {"sx": ""}, "no standard uncertainty sx"),
    "zero sigma of a direction": ("direction", {"sigma": "0"}, "larger than zero"),
    "no sigma of a distance": ("distance", {"sigma": ""}, "no standard uncertainty"),
    "no sigma of an angle": ("angles", {"sazimuth": ""}, "no standard uncertainty sazimuth"),
    "negative sigma of a tilt": ("tilt", {"sigma": "-1e-5"}, "larger than zero"),
    "no sigma of an attitude": ("pose", {"srx": ""}, "no standard uncertainty srx"),
    "unknown instrument": ("point", {"instrument": "T9"}, "unknown instrument 'T9'"),
    "no instrument": ("point", {"instrument": ""}, "does not say which instrument"),
    "unknown kind": ("point", {"kind": "height"}, "Expected one of point, direction"),
    "unknown nest": ("point", {"nest": "p9"}, "unknown nest 'p9'"),
    "unknown second nest": ("distance", {"nest2": "p9"}, "Expected one of p1"),
    "distance to itself": ("distance", {"nest2": "p3"}, "another nest"),
    "distance zero": ("distance", {"value": "0"}, "larger than zero"),
    "value of another kind": ("point", {"value": "1.0"}, "in a row of kind point"),
    "axis too long": ("direction", {"ax": "1.0"}, "the length"),
    "norm": ("pose", {"qw": "0.2"}, "the quaternion has the norm"),
    "both attitudes": ("pose", {"rx": "0", "ry": "0", "rz": "0"}, "both a quaternion and angles"),
    "target on the base": ("pose", {"nest": "b1"}, "a nest of the platform"),
    "elevation": ("angles", {"elevation": "2.0", "selevation": "1e-5"}, "elevation in rad"),
    "text": ("tilt", {"value": "flat"}, "finite number"),
    "nothing read": ("angles", dict.fromkeys(
        ("azimuth", "elevation", "sazimuth", "selevation"), ""), "holds no reading"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_fault_is_named_with_its_line_and_column(texts, name: str) -> None:
    kind, values, says = CASES[name]
    made, line = changed(texts, kind, **values)
    with pytest.raises(BadInput, match=says) as caught:
        parse_run(*made, actuators=3)
    assert f"line {line}, column " in caught.value.place
    assert caught.value.remedy


def test_a_plane_is_touched_from_its_side_and_by_an_instrument_of_the_base(texts) -> None:
    def touched(row):
        return row["plane"] == "bed"

    for values, says in (
        ({"value": "-0.5"}, "touched from behind"),
        ({"plane": "floor"}, r"unknown plane 'floor'"),
        ({"instrument": "tracker"}, "mixed frames"),
        ({"ax": "1", "ay": "0", "az": "0"}, "both a plane and an axis"),
    ):
        made, line = changed(texts, "direction", touched, **values)
        with pytest.raises(BadInput, match=says) as caught:
            parse_run(*made, actuators=3)
        assert f"line {line}, column " in caught.value.place


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"instruments": {"tracker": {"frame": "sideways"}}}, "frame is 'sideways'"),
        ({"instruments": {"gauge": {"frame": "base", "zero_sigma": 0.0}}}, "greater than 0"),
        ({"planes": {"bed": {"normal": [0, 0, 2], "through": [0, 0, 0]}}}, "the length 2"),
        ({"nests": {"platform": {"p1": {"at": [0, 0, 0]}}, "base": {}}}, "one of sigma"),
        ({"nests": {"platform": {"p1": {"at": [0, 0, 0], "sigma": -1.0}}, "base": {}}}, "sigma"),
        (
            {"nests": {"platform": {"p1": {"at": [0, 0, 0], "covariance": [1, 1, 1, 2, 0, 0]}}}},
            "not positive",
        ),
    ],
)
def test_a_fault_of_the_setup_is_named(texts, table, says: str) -> None:
    header = everything(load("delta"), seed=2, poses=4, share=0.2).header
    text = tomli_w.dumps({"format": "pkm-run/2", **header, **table})
    with pytest.raises(BadInput, match=says):
        parse_run(text, texts[1], actuators=3)


def test_an_instrument_without_a_place_to_begin_is_refused_by_name(texts) -> None:
    from calib.identify import fit
    from calib.model import Model

    machine = load("delta")
    header = texts[0].replace("near =", "nearly =")
    with pytest.raises(BadInput, match="nearly"):
        parse_run(header, texts[1], actuators=3)
    lab = everything(machine, seed=2, poses=4, share=0.2)
    del lab.header["instruments"]["theodolite"]["near"]
    rows = stack(machine, [parse_run(*lab.texts(), actuators=3)])
    with pytest.raises(BadInput, match="cannot tie theodolite") as caught:
        fit(Model(rows))
    assert "near = " in caught.value.remedy


def test_the_program_answers_with_code_2(texts, tmp_path, capsys) -> None:
    made, line = changed(texts, "distance", value="0")
    for name, text in zip(("run.toml", "points.csv"), made, strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert pkmcal(["fit", str(tmp_path)]) == 2
    assert f"line {line}, column value" in capsys.readouterr().err
