"""What is exported is read back as the controller would, and is what the model holds."""

import csv
import io
import json
import math
import re
import tomllib
from pathlib import Path

import pytest

from app.cli import run
from app.files.machines import load_machine
from app.jobs.exporting import Corrected, Number, corrected, export, rendered
from calib.effects.struts import struts_of
from calib.errors import BadInput
from drivers.kind import Strut
from drivers.linuxcnc.places import Places

RUN = Path(__file__).parents[1] / "data" / "runs" / "backlash-leg-3"


def found(machine: str, effects: tuple[Number, ...] = ()) -> Corrected:
    """A machine whose every parameter is a little off its drawing."""
    described = load_machine(machine)
    numbers = tuple(
        Number(p.name, p.nominal + 1e-3 * k, 0.01, p.unit, *p.name.partition(".")[::2])
        for k, p in enumerate(described.parameters, start=1)
    )
    return Corrected(described, "model.toml", numbers, effects, ("two-face",))


def shipped(form: str) -> str:
    from importlib.resources import files

    return files("app.templates").joinpath(f"export-{form}.j2").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "model.toml"
    assert run(["fit", str(RUN), "--add", "backlash", "--save", str(path)]) == 0
    return path


def test_forms_of_a_model_hold_its_values_to_the_last_bit(
    model: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    values = corrected(model).values
    assert values["backlash.leg3"] != 0.0
    saved = {one["name"]: one["value"] for one in tomllib.loads(model.read_text())["parameters"]}
    assert {name: saved[name] for name in values} == values
    for form, read in (("json", json.loads), ("toml", tomllib.loads)):
        table = read(export(model, form))
        assert {**table["parameters"], **table["effects"]} == values
    rows = csv.DictReader(io.StringIO(export(model, "csv")))
    assert {row["name"]: float(row["value"]) for row in rows} == values
    out = tmp_path / "p.txt"
    assert run(["export", str(model), "--as", "p-variables", "--out", str(out)]) == 0
    lines = re.findall(r"^P(\d+)=(\S+) ; (\S+)", out.read_text(encoding="utf-8"), re.MULTILINE)
    assert [int(number) for number, _, _ in lines] == list(range(1000, 1000 + len(values)))
    assert {n: float(v) for _, v, n in lines} == pytest.approx(values, abs=1e-12)
    assert run(["export", str(model), "--as", "json", "--out", str(out)]) == 2
    assert "--force" in capsys.readouterr().err


def test_hal_is_read_back_as_linuxcnc_s_pins() -> None:
    twist = (Number("screw-twist.L", -2.0, 0.01, "mm", "screw-twist", "L"),)
    given = found("linuxcnc", twist)
    pins = {
        name: float(value)
        for name, value in re.findall(
            r"^setp (\S+) (\S+)$", rendered(shipped("hal"), given, "hal"), re.M
        )
    }
    struts = tuple(Strut(**vars(strut)) for strut in struts_of(given.machine))
    places = Places.of([one.name for one in given.parameters], struts)
    back = places.parameters(pins)
    assert {name: back[name] for name in given.values} == pytest.approx(given.values, abs=1e-12)


@pytest.mark.parametrize("machine", ["delta", "delta-printer"])
def test_delta_s_gcode_is_read_back(machine: str) -> None:
    given = found(machine)
    text = rendered(shipped("gcode-delta"), given, "gcode-delta")
    lines = [line.split() for line in text.splitlines() if line.startswith("M66")]
    assert [line[0] for line in lines] == ["M665", "M666"]
    first, second = ({word[0]: float(word[1:]) for word in line[1:]} for line in lines)
    value, towers = given.values, ("tower1", "tower2", "tower3")
    nominal = {p.name: p.nominal for p in given.machine.parameters}
    for tower, rod, angle in zip(towers, "ABC", "XYZ", strict=True):
        rods = [v for n, v in value.items() if n.startswith(f"{tower}.length")]
        assert first["L"] + first[rod] == pytest.approx(sum(rods) / len(rods), abs=2e-6)
        turned = math.radians(first[angle])
        azimuth = f"{tower}.azimuth"
        wanted = value[azimuth] - nominal[azimuth] if azimuth in value else 0.0
        assert turned == pytest.approx(wanted, abs=1e-7)
        # Once M666 is added every carriage stands as low as the lowest.
        lowest = min(value[f"{t}.zero"] for t in towers)
        assert value[f"{tower}.zero"] + second[angle] == pytest.approx(lowest, abs=2e-6)
    radii = [v for n, v in value.items() if n.endswith("radius")]
    assert first["R"] == pytest.approx(sum(radii) / len(radii) - 30.0, abs=1e-6)
    assert ("no word for" in text) == (machine == "delta")


def test_forms_of_one_kind_of_machine_refuse_others() -> None:
    with pytest.raises(BadInput, match="deltas"):
        rendered(shipped("gcode-delta"), found("hexapod"), "gcode-delta")
    with pytest.raises(BadInput, match="genhexkins"):
        rendered(shipped("hal"), found("delta"), "hal")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("ok\n{{ nonsense }}\n", 2),
        ("ok\n\n{{ value['leg9.L0'] }}", 3),
        ("{% for one in parameters %}\n{{ one.name }}", 2),
        ("{{ 1 / 0 }}", 1),
        ("a\n{{ machine.__class__.__mro__ }}", 2),
        ("a\nb\n{{ 'x' | no_such_filter }}", 3),
        ("{% include '/etc/passwd' %}", 1),
        ("a\n{{ range(10 ** 9) | list }}", 2),
    ],
)
def test_fault_of_a_template_is_bad_input_with_its_line(text: str, line: int) -> None:
    with pytest.raises(BadInput) as caught:
        rendered(text, found("delta"), "mine.j2")
    assert f"mine.j2, line {line}" in str(caught.value)


def test_own_template_and_unknown_form(model: Path, tmp_path: Path) -> None:
    own = tmp_path / "mine.j2"
    own.write_text(
        '{% for one in parameters if one.what == "L0" %}\n{{ "%.9f" % one.value }}\n{% endfor %}\n'
    )
    values = corrected(model).values
    said = [float(line) for line in export(model, str(own)).split()]
    assert said == pytest.approx([v for n, v in values.items() if n.endswith(".L0")], abs=1e-9)
    with pytest.raises(BadInput, match="there is no form"):
        export(model, "xml")
