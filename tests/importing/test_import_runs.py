"""What instruments export becomes the run that it was, by maps; whatever was assumed is written."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal
from app.files.foreign_table import read_foreign
from app.files.import_map import parse_map
from app.files.imported import imported
from app.files.runs import read_run
from app.files.shipped_maps import shipped_map, shipped_maps
from app.jobs.importing import import_run
from calib.errors import BadInput
from calib.mechanism.solve import forward
from calib.runs.record import Run
from tests.importing.conftest import Bench, same


def brought(bench: Bench, table: Path, plan: Path | str, out: Path, **more: object):
    return import_run(table, plan, out, header=bench.header, **more)


def unlooked(bench: Bench, table: Path, plan: Path) -> Run:
    """The run of a table, before anything is asked of it."""
    read = parse_map(plan.read_text(), str(plan))
    foreign = read_foreign(table, read.layout)
    header = bench.run.header if read.setup is None else replace(bench.run.header, setup=read.setup)
    found = imported([foreign], None, read, bench.loaded.machine, header)
    return found.runs[""]


def test_a_table_with_units_in_its_header_is_the_run_that_it_was(bench, tmp_path) -> None:
    def comma(value: float) -> str:
        return repr(value).replace(".", ",")

    run = replace(bench.run, q=bench.run.q / 25.4, position=bench.run.position / 1000.0)
    units = "time[s],q[in],x[m]"
    table = bench.table(tmp_path / "a.csv", run, units=units, cell=comma, delimiter=";")
    plan = bench.plan(tmp_path / "map.toml", delimiter=";", decimal=",")
    report = brought(bench, table, plan, tmp_path / "run")
    found = read_run(tmp_path / "run").run
    assert same(found, bench.run)
    assert np.allclose(found.time_s, bench.run.time_s[bench.run.measured] - 6.0)
    assert report.record == ()
    assert report.readings == bench.run.readings


def test_whatever_was_assumed_stands_in_the_run(bench, tmp_path) -> None:
    table = bench.table(tmp_path / "a.csv")
    report = brought(bench, table, bench.plan(tmp_path / "map.toml"), tmp_path / "run")
    said = tomllib.loads((tmp_path / "run" / "run.toml").read_text())["imported"]
    assert said["assumed"] == list(report.assumed)
    assert any("5 um" in one for one in report.assumed)
    assert [file["name"] for file in said["files"]] == ["a.csv"]
    assert (tmp_path / "run" / "import-map.toml").read_text() == (tmp_path / "map.toml").read_text()


def spatial_analyzer(bench: Bench, folder: Path) -> tuple[Path, Path]:
    """Points as SpatialAnalyzer writes them, and what was commanded beside them."""
    run, lines = bench.run, ["// SpatialAnalyzer export", "// Frame: A::WORLD"]
    told = {}
    for k in np.flatnonzero(run.measured):
        group = f"P{run.pose[k]}" if run.pose[k] else "REF"
        x, y, z = run.position[:, k]
        lines.append(f"A {group} {run.nest[k]} {x:.6f} {y:.6f} {z:.6f}")
        if run.pose[k]:
            told[group] = ",".join(map(repr, run.q[:, k].tolist()))
    (folder / "sa.txt").write_text("\n".join(lines) + "\n")
    commands = ["pose,q1[mm],q2[mm],q3[mm]", *(f"{pose},{q}" for pose, q in told.items())]
    (folder / "commands.csv").write_text("\n".join(commands) + "\n")
    return folder / "sa.txt", folder / "commands.csv"


def test_points_of_spatial_analyzer_with_commands_beside_them(bench, tmp_path) -> None:
    points, commands = spatial_analyzer(bench, tmp_path)
    report = brought(bench, points, "spatial-analyzer", tmp_path / "run", commands=commands)
    assert same(read_run(tmp_path / "run").run, bench.run, tolerance=1e-6)
    assert "the file holds no times: rows are 10 s apart" in report.assumed
    assert report.record == ()


def test_points_of_polyworks_name_pose_and_nest_in_one(bench, tmp_path) -> None:
    points, commands = spatial_analyzer(bench, tmp_path)
    rows = [line.split() for line in points.read_text().splitlines()[2:]]
    (tmp_path / "pw.txt").write_text("".join(f"{g}_{n},{x},{y},{z}\n" for _, g, n, x, y, z in rows))
    brought(bench, tmp_path / "pw.txt", "polyworks", tmp_path / "run", commands=commands)
    assert same(read_run(tmp_path / "run").run, bench.run, tolerance=1e-6)


def test_the_plain_table_ships_too(bench, tmp_path) -> None:
    table = bench.table(tmp_path / "a.csv")
    lines = table.read_text().splitlines()
    text = [lines[0] + ",sx[um],sy[um],sz[um]", *(line + ",5,5,5" for line in lines[1:])]
    table.write_text("\n".join(text) + "\n")
    brought(bench, table, "table", tmp_path / "run")
    found = read_run(tmp_path / "run").run
    assert np.allclose(np.einsum("iin->in", found.covariance[:, :, found.measured]), 0.005**2)


@pytest.mark.parametrize("name", shipped_maps())
def test_shipped_maps_are_read_and_say_what_they_assume(name: str) -> None:
    text = shipped_map(name)
    assert parse_map(text, name).readings
    assert "--header" in text


def test_commanded_poses_become_what_the_machine_needs_for_them(bench, tmp_path) -> None:
    """Quaternions, angles in any order: the same actuator coordinates."""
    from scipy.spatial.transform import Rotation

    run, machine = bench.run, bench.loaded.machine
    poses = forward(machine, machine.extension(run.q)).poses
    turned = Rotation.from_matrix(np.moveaxis(poses.rotation, -1, 0))
    written = {
        "XYZ": np.degrees(turned.as_euler("XYZ")),
        "zyx": np.degrees(turned.as_euler("zyx")),
        "quaternion wxyz": turned.as_quat(scalar_first=True),
        "rotation vector": np.degrees(turned.as_rotvec()),
    }
    for order, turns in written.items():
        names = [f"t{k}" for k in range(turns.shape[1])]
        lines = ["time[s],pose,nest,X[mm],Y[mm],Z[mm]," + ",".join(names) + ",x[mm],y[mm],z[mm]"]
        for k in np.flatnonzero(run.measured):
            numbers = [*poses.position[:, k], *turns[k], *run.position[:, k]]
            lines.append(
                f"{run.time_s[k]},{run.pose[k]},{run.nest[k]},"
                + ",".join(f"{value:.12g}" for value in numbers)
            )
        (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
        plan = bench.plan(tmp_path / "map.toml").read_text()
        unit = "" if order.startswith("quat") else 'unit = "deg"\n'
        pose = (
            f'[commanded_pose]\nrotation = "{order}"\n[commanded_pose.place]\n'
            f'columns = ["X", "Y", "Z"]\n[commanded_pose.turn]\ncolumns = {names}\n{unit}'
        )
        plan = plan.replace('[actuators]\ncolumns = "q*"\n', pose)
        (tmp_path / "map.toml").write_text(plan)
        found = unlooked(bench, tmp_path / "a.csv", tmp_path / "map.toml")
        assert same(found, run, tolerance=1e-6), order


@pytest.mark.parametrize("rotation", ["zyx", "quaternion xyzw", "rotation vector"])
def test_measured_poses_and_directions_make_a_run_of_version_2(bench, tmp_path, rotation) -> None:
    """A 6-D probe and a theodolite in the base's frame: numbers in the units of their programs."""
    from scipy.spatial.transform import Rotation

    run, machine = bench.run, bench.loaded.machine
    posed = [k for k in np.flatnonzero(run.measured) if run.nest[k] == "p1"]
    poses = forward(machine, machine.extension(run.q)).poses
    nest = poses.points(run.header.platform_nests["p1"][:, None])
    turned = Rotation.from_matrix(np.moveaxis(poses.rotation, -1, 0))
    turns = {
        "zyx": np.degrees(turned.as_euler("zyx")),
        "quaternion xyzw": turned.as_quat(),
        "rotation vector": np.degrees(turned.as_rotvec()),
    }[rotation]
    names = [f"t{k}" for k in range(turns.shape[1])]
    lines = [f"pose,q1[mm],q2[mm],q3[mm],X[m],Y[m],Z[m],{','.join(names)},hz[gon],v[gon]"]
    for k in posed:
        x, y, z = nest[:, k]
        circles = np.array([np.arctan2(x, y), np.arccos(z / np.linalg.norm(nest[:, k]))])
        cells = [*run.q[:, k], *(nest[:, k] / 1e3), *turns[k], *(circles * 200.0 / np.pi)]
        lines.append(f"{run.pose[k]}," + ",".join(f"{value:.12g}" for value in cells))
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    head = (
        'format = "pkm-import/1"\n[time]\nstep_s = 1.0\n[pose]\ncolumn = "pose"\n'
        '[actuators]\ncolumns = "q*"\n[instruments.base]\nframe = "base"\n'
    )
    unit = "" if rotation.startswith("quat") else ', unit = "deg"'
    (tmp_path / "pose.toml").write_text(
        head + '[[reading]]\nkind = "pose"\nnest = "p1"\ninstrument = "base"\n'
        f'rotation = "{rotation}"\nplace = {{ columns = ["X", "Y", "Z"] }}\n'
        f"turn = {{ columns = {names}{unit} }}\n"
        '[sigma]\nplace = "20 um"\nturn = "0.002 deg"\n'
    )
    (tmp_path / "angles.toml").write_text(
        head + '[[reading]]\nkind = "angles"\nnest = "p1"\ninstrument = "base"\n'
        'columns = ["hz", "v"]\nvertical = "zenith"\nhorizontal = "clockwise"\n'
        '[sigma]\nangle = "0.001 deg"\n'
    )
    found = unlooked(bench, tmp_path / "a.csv", tmp_path / "pose.toml")
    assert found.sensing is not None
    assert np.allclose(found.position, nest[:, posed], atol=1e-6)
    assert np.allclose(found.sensing.attitude, poses.rotation[:, :, posed], atol=1e-9)
    assert np.allclose(np.diag(found.sensing.spread[:, :, 0])[3:], np.radians(0.002) ** 2)
    brought(bench, tmp_path / "a.csv", tmp_path / "angles.toml", tmp_path / "run")
    found = read_run(tmp_path / "run").run
    x, y, z = nest[:, posed]
    clockwise = np.arctan2(y, x) - 0.5 * np.pi
    assert np.allclose(np.angle(np.exp(1j * (found.position[0] - clockwise))), 0.0, atol=1e-9)
    assert np.allclose(found.position[1], np.arctan2(z, np.hypot(x, y)), atol=1e-9)
    # Half a direction is a reading, half a pose is none, and neither is left out in silence.
    table = tmp_path / "a.csv"
    names, first, *rest = table.read_text().splitlines()
    half = ",".join([*first.split(",")[:-1], ""])
    table.write_text("\n".join([names, half, *rest, ""]))
    brought(bench, table, tmp_path / "angles.toml", tmp_path / "half")
    again = read_run(tmp_path / "half").run
    assert again.readings == len(posed)
    assert again.sensing.seen[:, again.measured][:2, 0].tolist() == [True, False]
    at = names.split(",").index("t1")
    part = [cell if k != at else "" for k, cell in enumerate(first.split(","))]
    table.write_text("\n".join([names, ",".join(part), *rest, ""]))
    with pytest.raises(BadInput, match="a part of the pose is missing") as caught:
        unlooked(bench, table, tmp_path / "pose.toml")
    assert "line 2" in str(caught.value)


def test_gears_signs_zeros_and_counts(bench, tmp_path) -> None:
    """q1 by a geared screw, q2 turned round, q3 in counts."""
    run = bench.run
    told = run.q.copy()
    told[0] = (run.q[0] - 100.0) * 7.0 / 5.0  # turns of a motor before 7:1 and 5 mm a turn
    told[1] = -(run.q[1] + 3.0)
    told[2] = np.round(run.q[2] / 1e-6)
    table = bench.table(tmp_path / "a.csv", replace(run, q=told), units="time[s],q[1],x[mm]")
    text = table.read_text().replace("q1[1],q2[1],q3[1]", "m1[turn],m2[mm],m3")
    table.write_text(text)
    plan = bench.plan(tmp_path / "map.toml")
    said = (
        'columns = ["m1", "m2", "m3"]\nsign = [1, -1, 1]\ngear = [7, 1, 1]\n'
        'scale = ["5 mm/turn", 1.0, "0.001 um"]\noffset = ["100 mm", -3.0, 0.0]\n'
    )
    plan.write_text(plan.read_text().replace('columns = "q*"\n', said))
    brought(bench, table, plan, tmp_path / "run")
    assert same(read_run(tmp_path / "run").run, run, tolerance=1e-5)


def test_several_smrs_in_a_row_and_several_stations(bench, tmp_path) -> None:
    run = bench.run
    poses = list(dict.fromkeys(pose for pose in run.pose if pose and pose != "home"))
    nests = list(run.header.platform_nests)
    where = {(run.pose[k], run.nest[k]): k for k in np.flatnonzero(run.measured)}
    lines = ["when,q1[mm],q2[mm],q3[mm]," + ",".join(f"{n}.{a}[mm]" for n in nests for a in "xyz")]
    for number, pose in enumerate(poses):
        found = [where.get((pose, nest)) for nest in nests]
        first = next(k for k in found if k is not None)
        cells = [c for k in found for c in (run.position[:, k] if k is not None else ("-",) * 3)]
        moment = f"12:{58 + number // 5}:{number % 5:02d}"
        lines.append(",".join(map(str, [moment, *run.q[:, first], *cells])))
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    readings = "".join(
        f'[[reading]]\nnest = "{n}"\ncolumns = ["{n}.x", "{n}.y", "{n}.z"]\n' for n in nests
    )
    (tmp_path / "map.toml").write_text(
        'format = "pkm-import/1"\n[file]\nmissing = ["-"]\n'
        '[time]\ncolumn = "when"\nform = "clock"\n'
        '[pose]\nsame_joints = true\n[station]\ncolumn = "when"\npattern = "^..:5[89]"\n'
        f'[actuators]\ncolumns = "q*"\n{readings}[sigma]\nvalue = "5 um"\n'
    )
    report = brought(bench, tmp_path / "a.csv", tmp_path / "map.toml", tmp_path / "runs")
    assert [Path(one).name for one in report.runs] == ["12-58", "12-59"]
    found = [read_run(one).run for one in report.runs]
    assert sum(one.readings for one in found) == sum(bool(pose) for pose, _ in where)
    assert [len(set(one.pose)) for one in found] == [5, len(poses) - 5]
    assert "2 stations: a run each, as each has a frame of its own" in report.assumed


BAD = {
    "unit nowhere": ("x[mm]", "x", "nothing says the unit of column"),
    "unit of another kind": ("x[mm]", "x[deg]", "no unit of what is measured"),
    "unknown nest": (",p1,", ",p9,", 'unknown nest "p9"'),
    "half a position": (None, None, "a reading lacks"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_brought_is_named_with_its_line(bench, tmp_path, case) -> None:
    before, after, said = BAD[case]
    table = bench.table(tmp_path / "a.csv")
    lines = table.read_text().splitlines()
    if before is None:
        lines[7] = lines[7].rpartition(",")[0] + ","
    text = "\n".join(lines) + "\n"
    table.write_text(text if before is None else text.replace(before, after, 1))
    with pytest.raises(BadInput) as wrong:
        brought(bench, table, bench.plan(tmp_path / "map.toml"), tmp_path / "run")
    assert said in str(wrong.value)
    assert "line" in wrong.value.place or "map.toml" in wrong.value.place
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('[pose]\ncolumn = "pose"\n|', "nothing says which poses belong together"),
        ('[nest]\ncolumn = "nest"\n|', "nothing says in which nest"),
        ('value = "5 um"|', "nothing says how uncertain"),
        ('column = "time"|', "nothing says when a row was read"),
        ('[actuators]\ncolumns = "q*"\n|', "nothing says what was commanded"),
        ('column = "pose"|column = "pose"\npattern = "("', "no pattern"),
        ('delimiter = ","|delimiter = "x"', "delimiter is 'x'"),
        ('decimal = "."|decimal = ","', "a comma cannot stand between columns"),
        ('columns = "q*"|columns = "q*"\nsign = 2', "a sign is 1 or -1"),
        ('columns = "q*"|columns = "q*"\nunit = "kg"', "q"),
        ('columns = "q*"|columns = ["q1"]', "1 columns are named for 3 actuators"),
        ('column = "time"|column = "time"\nform = "noon"', "form is 'noon'"),
        ('decimal = "."|decimel = "."', 'unknown key "decimel"'),
        ("[sigma]|[sigmas]", 'unknown key "sigmas"'),
    ],
)
def test_a_map_that_says_too_little_is_refused(bench, tmp_path, change: str, said: str) -> None:
    before, _, after = change.partition("|")
    plan = bench.plan(tmp_path / "map.toml")
    plan.write_text(plan.read_text().replace(before, after))
    with pytest.raises(BadInput, match=said.replace("*", r"\*")) as wrong:
        brought(bench, bench.table(tmp_path / "a.csv"), plan, tmp_path / "run")
    assert "map.toml" in wrong.value.place


def test_times_of_every_form(bench, tmp_path) -> None:
    run = bench.run
    first = np.flatnonzero(run.measured)[:4]
    table = bench.table(tmp_path / "a.csv")
    rows = table.read_text().splitlines()
    forms = {
        "iso": [
            "2024-05-31T23:59:58.5+02:00",
            "2024-05-31 22:00:00+00:00",
            "20240601T000003,25+0200",
        ],
        "clock": ["11:59:58.5 PM", "00:00:00", "0:00:03,25"],
        "%d.%m.%Y %H:%M:%S.%f": [
            "31.05.2024 23:59:58.5",
            "01.06.2024 00:00:00.0",
            "01.06.2024 0:0:3.25",
        ],
    }
    for form, moments in forms.items():
        lines = ["when" + rows[0].removeprefix("time[s]")]
        for k, row in enumerate(rows[1:]):
            lines.append(f'"{moments[min(k, 2)]}",{row.partition(",")[2]}')
        (tmp_path / "b.csv").write_text("\n".join(lines) + "\n")
        plan = bench.plan(tmp_path / "map.toml")
        plan.write_text(
            plan.read_text().replace('column = "time"', f'column = "when"\nform = "{form}"')
        )
        found = unlooked(bench, tmp_path / "b.csv", plan)
        assert found.time_s[: first.size].tolist() == [0.0, 1.5, 4.75, 4.75], form


def test_the_verb_answers_and_a_run_is_never_written_over(bench, tmp_path, capsys) -> None:
    table, plan = bench.table(tmp_path / "a.csv"), bench.plan(tmp_path / "map.toml")
    words = ["import", str(table), "--map", str(plan), "--header", str(bench.header), "--out"]
    assert pkmcal([*words, str(tmp_path / "run")]) == 0
    assert "The data contradict none of it." in capsys.readouterr().out
    assert pkmcal([*words, str(tmp_path / "run")]) == 2
    assert pkmcal(["import", str(table), "--out", str(tmp_path / "other")]) == 2
    assert "--guess writes a first one" in capsys.readouterr().err
