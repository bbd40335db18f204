"""pkmcal kinematics: there and back, units in heads and cells, a model's geometry, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.cli import run
from app.files.unit_columns import column
from calib.errors import BadInput
from tests.answers import faults_of

Q = "pose,q1 [deg],q2,q3,q4,q5_deg,q6 (rad)\na,10,5 deg,0.1,-0.2,45,0\nb,-20,0.1,0,0.3,60,1\n"


@pytest.fixture
def asked(tmp_path: Path) -> Path:
    (tmp_path / "q.csv").write_text(Q)
    return tmp_path


@pytest.mark.parametrize("degrees", [False, True])
def test_there_and_back(asked: Path, degrees: bool) -> None:
    there = pkmcal.kinematics("arm", asked / "q.csv", "forward")
    (asked / "p.csv").write_text(there.table(degrees=degrees))
    back = pkmcal.kinematics("arm", asked / "p.csv", "inverse")
    wanted = [[np.deg2rad(10), np.deg2rad(5), 0.1, -0.2, np.pi / 4, 0.0],
              [np.deg2rad(-20), 0.1, 0.0, 0.3, np.pi / 3, 1.0]]  # fmt: skip
    assert np.allclose([one.q for one in there.places], wanted, atol=1e-12)
    assert np.allclose([one.q for one in back.places], wanted, atol=1e-7)
    assert [one.pose_name for one in back.places] == ["a", "b"]
    assert "-0," not in there.table()


def test_a_model_brings_its_geometry(asked: Path) -> None:
    plain = pkmcal.kinematics("arm", asked / "q.csv", "forward")
    (asked / "model.json").write_text(
        json.dumps(
            {
                "format": "pkm-fit/1",
                "effects": [],
                "parameters": [
                    {"name": "arm.a2", "value": 456.0, "sigma": 0.1, "unit": "mm", "nominal": 455.0}
                ],
            }
        )
    )
    longer = pkmcal.kinematics("arm", asked / "q.csv", "forward", model=asked / "model.json")
    apart = np.array(longer.places[0].pose[:3]) - np.array(plain.places[0].pose[:3])
    assert np.linalg.norm(apart) == pytest.approx(1.0, abs=1e-9)


def test_where_the_machine_does_not_close_and_where_a_limit_is_passed(asked: Path) -> None:
    (asked / "p.csv").write_text("x,y,z,rx [deg],ry [deg],rz [deg]\n9000,0,0,0,45,0\n")
    (far,) = pkmcal.kinematics("arm", asked / "p.csv", "inverse").places
    assert (far.closes, far.q, far.pose) == (False, None, None)
    (asked / "q.csv").write_text("q1 [deg],q2,q3,q4,q5,q6\n130,0,0,0,0.7,0\n")
    (turned,) = pkmcal.kinematics("arm", asked / "q.csv", "forward").places
    assert turned.closes
    assert "q1 passes its limit: 130 deg" in turned.why


def test_answers_by_its_schema(asked: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["kinematics", "arm", "--forward", str(asked / "q.csv"), "--json"]) == 0
    assert faults_of(json.loads(capsys.readouterr().out)) == []
    assert run(["kinematics", "arm", "--forward", str(asked / "q.csv")]) == 0
    assert capsys.readouterr().out.startswith("pose,x [mm],")
    assert run(["kinematics", "arm"]) == 2


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("q1,q2,q3,q4,q5\n0,0,0,0,1\n", "no column q6"),
        ("q1 [mm],q2,q3,q4,q5,q6\n0,0,0,0,1,0\n", 'the unit "mm" of column q1'),
        ("q1,q2,q3,q4,q5,q6\n0,0,0,0,nan,0\n", "not a finite number"),
        ("q1,q2,q3,q4,q5,q6\n0,0,0,0,1 mm,0\n", "does not measure"),
        ("q1,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,1,0\n", "there twice"),
        ("q1,q2,q3,q4,q5,q6\n0,0,0\n", "3 cells under 6"),
        ("q1,q2,q3,q4,q5,q6\n", "no row"),
    ],
)
def test_what_cannot_be_read_is_named(asked: Path, text: str, what: str) -> None:
    (asked / "q.csv").write_text(text)
    with pytest.raises(BadInput, match=r"q\.csv") as told:
        pkmcal.kinematics("arm", asked / "q.csv", "forward")
    assert what in str(told.value)


def test_heads_name_their_unit_in_three_ways() -> None:
    for head in ("rx [deg]", "rx (deg)", "rx_deg"):
        found = column(head, {"rx": "rad"}, "here")
        assert (found.name, found.measures) == ("rx", "rad")
        assert found.number("180", "here") == pytest.approx(np.pi)
        assert found.number("1 rad", "here") == pytest.approx(1.0)
    assert column("time_s", {"rx": "rad"}, "here").measures == ""


def test_tables_of_wanted_poses_may_be_in_degrees(tmp_path: Path) -> None:
    from app.files.machines import load_machine
    from app.files.wanted_poses import read_wanted

    machine = load_machine("hexapod")
    plain, degrees = tmp_path / "rad.csv", tmp_path / "deg.csv"
    plain.write_text(f"x,y,z,rx,ry,rz,payload_kg\n1,2,230,{np.deg2rad(5)},0,{np.deg2rad(-3)},4\n")
    degrees.write_text("x [cm],y,z,rx [deg],ry,rz,payload_kg\n0.1,2,230,5,0,-3 deg,4\n")
    with pytest.raises(BadInput, match="unit"):
        read_wanted(degrees, machine)
    degrees.write_text("x [m],y,z,rx [deg],ry,rz,payload_kg\n0.001,2,230,5,0,-3 deg,4\n")
    one, other = read_wanted(plain, machine), read_wanted(degrees, machine)
    assert np.allclose(one.task, other.task, atol=1e-12)
    assert other.channels["payload_kg"] == [4.0]
