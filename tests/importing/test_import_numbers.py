"""Numbers of one instrument (heights, gauges, bars), and the times that sheets write."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal
from app.files.machines import load_machine
from app.files.runs import read_run
from app.files.time_forms import are_days, form_of
from calib.identify import fit
from calib.mechanism.solve import inverse
from calib.model import Model
from calib.runs.stack import stack

HEAD = """format = "pkm-import/1"
machine = "delta"
[nests.platform]
tool = [0.0, 0.0, 0.0]
[nests.base]
anchor = [300.0, 0.0, 50.0]
[instruments.probe]
frame = "base"
axis = [0.0, 0.0, 1.0]
[planes.bed]
normal = [0.0, 0.0, 1.0]
through = [0.0, 0.0, 90.0]
[file]
encoding = "latin-1"
delimiter = ";"
decimal = ","
[time]
{time}
[pose]
column = "Nr"
[actuators]
columns = "q*"
[[reading]]
nest = "tool"
instrument = "probe"
columns = ["Höhe"]
{reading}
[sigma]
value = "{sigma}"
"""
Q = ("371,1503", "370,894", "369,0177")


def table(path: Path, times: list[str], head: str = "Höhe [mm]") -> Path:
    lines = [f"Nr;wann;q1 [mm];q2 [mm];q3 [mm];{head}"]
    lines += [f"{k};{when};{';'.join(Q)};10,{k:03d}" for k, when in enumerate(times)]
    path.write_bytes("\r\n".join([*lines, ""]).encode("latin-1"))
    return path


@pytest.mark.parametrize(
    ("reading", "kind", "held"),
    [
        ('kind = "height"', "point", {"z": "10.0", "sz": "0.01"}),
        ('kind = "direction"', "direction", {"value": "10.0", "sigma": "0.01"}),
        ('kind = "direction"\nplane = "bed"', "direction", {"value": "10.0", "plane": "bed"}),
        ('kind = "distance"\nnest2 = "anchor"', "distance", {"value": "10.0", "nest2": "anchor"}),
        ('kind = "tilt"\nunit = "deg"', "tilt", {"value": str(np.deg2rad(10.0))}),
    ],
)
def test_a_column_of_numbers_is_a_run_of_version_2(
    reading: str, kind: str, held: dict[str, str], tmp_path: Path
) -> None:
    angle = "tilt" in reading
    file = table(tmp_path / "a.csv", ["1"] * 3, "Höhe" if angle else "Höhe [mm]")
    plan = tmp_path / "map.toml"
    sigma = "0.01 deg" if angle else "10 um"
    plan.write_text(HEAD.format(time="step_s = 5.0", reading=reading, sigma=sigma), "utf-8")
    assert pkmcal(["import", str(file), "--map", str(plan), "--out", str(tmp_path / "run")]) == 0
    names, first, *_ = (tmp_path / "run" / "points.csv").read_text().splitlines()
    cells = dict(zip(names.split(","), first.split(","), strict=True))
    assert cells["kind"] == kind
    assert {name: cells[name] for name in held} == held
    assert read_run(tmp_path / "run").run.readings == 3


@pytest.mark.parametrize(
    ("reading", "sigma", "said"),
    [
        ('kind = "height"', "0 um", "how uncertain a number is"),
        ('kind = "height"\nplane = "bed"', "1 um", "a height touches no plane"),
        ('kind = "tilt"\nnest2 = "anchor"', "1 mrad", "a tilt has no other end"),
        ('kind = "distance"\nnest2 = "away"', "1 um", "anchor"),
        ('kind = "direction"\nplane = "away"', "1 um", "unknown plane"),
        ('kind = "tilt"', "1 mrad", "mm"),
    ],
)
def test_what_a_number_cannot_be_is_refused(
    reading: str, sigma: str, said: str, tmp_path: Path, capsys
) -> None:
    file = table(tmp_path / "a.csv", ["1"] * 3)
    plan = tmp_path / "map.toml"
    plan.write_text(HEAD.format(time="step_s = 5.0", reading=reading, sigma=sigma), "utf-8")
    assert pkmcal(["import", str(file), "--map", str(plan), "--out", str(tmp_path / "run")]) == 2
    assert said in capsys.readouterr().err


def test_a_probe_that_triggers_is_its_radius_at_the_latched_axes(tmp_path: Path, capsys) -> None:
    """Touches of a machine whose end stops are off; the ball's centre is 1.5 mm over the bed."""
    machine = load_machine("delta-printer")
    names = [parameter.name for parameter in machine.parameters]
    real = machine.nominal.copy()
    real[[names.index(f"tower{k}.zero") for k in (1, 2, 3)]] = 0.4, -0.3, 0.1
    x, y = np.meshgrid(np.linspace(-50.0, 50.0, 4), np.linspace(-50.0, 50.0, 4))
    task = np.array([x.ravel(), y.ravel(), np.full(16, 41.5)])
    q = machine.coordinates(inverse(machine, task, real).extension)
    file, plan = tmp_path / "touches.csv", tmp_path / "map.toml"
    rows = [f"{k},{','.join(f'{value:.6f}' for value in q[:, k])}" for k in range(16)]
    file.write_text("\n".join(["Nr,q1[mm],q2[mm],q3[mm]", *rows, ""]))
    text = HEAD.format(
        time="step_s = 5.0", reading='kind = "direction"\nplane = "bed"\nvalue = "1.5 mm"',
        sigma="1 um",
    )  # fmt: skip
    text = text.replace('"delta"', '"delta-printer"').replace('columns = ["Höhe"]\n', "")
    text = text.replace('delimiter = ";"\ndecimal = ","\n', "").replace("90.0]", "40.0]")
    plan.write_text(text, "utf-8")
    out = str(tmp_path / "run")
    assert pkmcal(["import", str(file), "--map", str(plan), "--out", out]) == 0
    found = fit(Model(stack(machine, [read_run(Path(out)).run])))
    assert found.rms_mm < 1e-4
    assert found.values[:9] == pytest.approx(real, abs=0.02)
    plan.write_text(text.replace('value = "1.5 mm"', 'value = "1.5 mm"\ncolumns = ["q1"]'))
    assert pkmcal(["import", str(file), "--map", str(plan), "--out", out + "2"]) == 2
    assert "both say what is read" in capsys.readouterr().err


@pytest.mark.parametrize("sigma", ["0", "-0,01", "", "nan", "wide"])
@pytest.mark.parametrize("kind", ["height", "distance", "xyz"])
def test_an_uncertainty_that_is_none_is_named_with_line_and_column(
    kind: str, sigma: str, tmp_path: Path, capsys
) -> None:
    file, plan = table(tmp_path / "a.csv", ["1"] * 3), tmp_path / "map.toml"
    lines = file.read_bytes().decode("latin-1").splitlines()
    lines = [lines[0] + ";sig [mm]", *(f"{line};0,01" for line in lines[1:])]
    lines[2] = lines[2].removesuffix("0,01") + sigma
    file.write_bytes("\n".join([*lines, ""]).encode("latin-1"))
    text = HEAD.format(time="step_s = 5.0", reading=f'kind = "{kind}"', sigma="")
    text = text.replace('value = ""', 'columns = ["sig"]')
    if kind == "distance":
        text = text.replace('kind = "distance"', 'kind = "distance"\nnest2 = "anchor"')
    if kind == "xyz":
        text = text.replace('["Höhe"]', '["Höhe", "Höhe", "Höhe"]')
        text = text.replace('["sig"]', '["sig", "sig", "sig"]')
    plan.write_text(text, "utf-8")
    assert pkmcal(["import", str(file), "--map", str(plan), "--out", str(tmp_path / "run")]) == 2
    assert "a.csv, line 3, column sig: " in capsys.readouterr().err


def test_excels_dates_are_read_or_refused_by_name(tmp_path: Path, capsys) -> None:
    days = [f"{46095.39 + 10.0 * k / 86400.0:.8f}".replace(".", ",") for k in range(4)]
    file, plan = table(tmp_path / "a.csv", days), tmp_path / "map.toml"
    asked = ["import", str(file), "--map", str(plan), "--out", str(tmp_path / "run")]
    time = 'column = "wann"'
    plan.write_text(HEAD.format(time=time, reading='kind = "height"', sigma="1 um"), "utf-8")
    assert pkmcal(asked) == 2
    said = capsys.readouterr().err
    assert "Excel's dates" in said
    assert 'form = "excel"' in said
    time += '\nform = "excel"'
    plan.write_text(HEAD.format(time=time, reading='kind = "height"', sigma="1 um"), "utf-8")
    assert pkmcal(asked) == 0
    assert read_run(tmp_path / "run").run.time_s == pytest.approx([0.0, 10.0, 20.0, 30.0], abs=1e-2)


@pytest.mark.parametrize(
    "form", ["%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%Y/%m/%d %H:%M", "iso", "clock"]
)
def test_the_form_of_a_time_is_found_from_the_times(form: str) -> None:
    moments = [datetime(2026, 3, 14, 9, 26, 53) + timedelta(hours=k) for k in range(5)]
    written = {"iso": "%Y-%m-%dT%H:%M:%S", "clock": "%H:%M:%S"}.get(form, form)
    assert form_of([one.strftime(written) for one in moments]) == form


def test_seconds_of_a_day_are_no_days() -> None:
    assert not are_days([34013.0 + 10.0 * k for k in range(50)])
    assert are_days([46095.39 + 10.0 * k / 86400.0 for k in range(50)])
