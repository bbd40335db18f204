"""Simulated campaigns: the format, the layout of the examples, the same physics as live."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from app.cli import run
from app.files.machines import load_machine
from calib.identify.staged import fit_effects
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.clock import ManualClock
from mocks.hidden.table import Hidden
from mocks.physics.hexapod_body import AROUND
from mocks.simulate import Profile, RunPlan, simulate
from mocks.simulate.files import points_csv, run_toml, truth_json
from mocks.simulate.run import SimulatedRun
from mocks.world import World, WorldPlan


def rows_of(run: SimulatedRun) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(points_csv(run))))


def test_layout_is_that_of_the_examples() -> None:
    rows = rows_of(simulate(RunPlan(seed=1, poses=60)))
    assert len(rows) == 201
    assert (rows[0]["pose"], rows[0]["nest"], rows[0]["x"]) == ("home", "", "")
    assert [r["nest"] for r in rows[1:5]] == ["b1", "b2", "b3", "b4"]
    assert {r["q1"] for r in rows[:5]} == {"230.715000"}
    assert [(r["pose"], r["nest"]) for r in rows[5:7]] == [("1", "3"), ("2", "3")]
    assert [r["nest"] for r in rows[-4:]] == ["b1", "b2", "b3", "b4"]
    times = [float(r["time_s"]) for r in rows]
    assert times == sorted(times)
    blocks = [i for i, r in enumerate(rows) if r["nest"] == "b1"]
    assert rows[blocks[1]]["q1"] == rows[blocks[1] + 4]["q1"]


def test_other_order_dwells_at_all_nests_of_a_pose() -> None:
    rows = rows_of(simulate(RunPlan(seed=1, poses=20, order="pose-by-pose")))
    assert [(r["pose"], r["nest"]) for r in rows[5:9]] == [
        ("1", "3"), ("1", "4"), ("1", "5"), ("2", "3"),
    ]  # fmt: skip


def test_cycles_are_numbered_visits_of_the_same_poses() -> None:
    made = simulate(RunPlan(seed=1, poses=4, cycles=3, order="pose-by-pose"))
    rows = [r for r in rows_of(made) if r["pose"] not in ("", "home")]
    assert [r["cycle"] for r in rows] == ["1"] * 12 + ["2"] * 12 + ["3"] * 12
    assert rows[0]["q1"] == rows[12]["q1"] == rows[24]["q1"]
    parse_run(run_toml(made), points_csv(made), actuators=6)


@pytest.mark.parametrize("noise", [0.005, None])
def test_files_are_read_by_the_reader_of_runs(noise: float | None) -> None:
    profile = Profile(payload_kg=(0.0, 5.0))
    held = {"leg1.L0": 230.8}
    plan = RunPlan(seed=2, poses=12, noise_mm=noise, delays=True, controller=held, profile=profile)
    made = simulate(plan)
    run = parse_run(run_toml(made), points_csv(made), actuators=6)
    assert run.header.controller_parameters["leg1.L0"] == 230.8


def test_same_seed_same_run_other_seed_other_run() -> None:
    first, again, other = (points_csv(simulate(RunPlan(seed=s, poses=10))) for s in (3, 3, 4))
    assert first == again
    assert first != other


def test_noise_does_not_shift_what_else_the_seed_draws() -> None:
    quiet, loud = (simulate(RunPlan(seed=5, poses=10, noise_mm=s)) for s in (0.001, 0.01))
    assert quiet.poses == pytest.approx(loud.poses)
    off = (loud.xyz - quiet.xyz)[loud.layout.reading]
    assert np.std(off) == pytest.approx(0.009, rel=0.2)


@pytest.mark.parametrize(
    "hidden",
    [{}, {"backlash.leg2": 0.02, "screw-pitch.leg1": 1e-3}, {"screw-twist.L": 2.0},
     {"gravity-sag.c": 1e-4, "nest-offset.4.x": 0.05, "joint-tilt.leg1.base.y": 1e-3},
     {"unknown.hysteresis.leg3": 0.02, "tracker-scale.k": 1e-5}],
)  # fmt: skip
def test_simulated_and_live_machine_are_the_same(hidden: dict[str, float]) -> None:
    effects = Hidden(hidden)
    made = simulate(RunPlan(seed=7, poses=15, noise_mm=1e-9, hidden=effects, order="pose-by-pose"))
    clock = ManualClock()
    live = World(clock, WorldPlan(seed=7, hidden=effects, smrs=3))
    for row, nest in enumerate(made.layout.nest):
        for leg, q in zip(live.legs, made.q[row], strict=True):
            leg.command(q - 230.715, 1.0)
        clock.advance(200.0)
        if nest in AROUND.platform_nests:
            now = np.array([clock.now()])
            seen = live.distortions.seen(live.nest_in_tracker(nest, now), now)[0]
            assert made.xyz[row] == pytest.approx(seen, abs=2e-6)


ON_MACHINES: list[tuple[str, dict[str, float]]] = [
    ("tripod", {}),
    ("tripod", {"backlash.limb1": 0.02, "parallelogram-sides.limb2": 0.05, "gravity-sag.c": 1e-4}),
    ("ptm", {"backlash.limb2": 1e-4, "gravity-sag.c": 1e-8, "screw-cyclic.limb1.cos": 1e-4}),
    ("ptm", {"redundancy.limb": 3.0, "screw-pitch.limb2": 1e-3, "unknown.hysteresis.limb1": 1e-4}),
]


@pytest.mark.parametrize(("machine", "hidden"), ON_MACHINES)
def test_simulated_and_live_machines_are_the_same(machine: str, hidden: dict[str, float]) -> None:
    effects = Hidden(hidden)
    made = simulate(RunPlan(machine=machine, seed=7, poses=6, noise_mm=1e-9, hidden=effects))
    clock = ManualClock()
    live = World(clock, WorldPlan(machine=machine, seed=7, hidden=effects, smrs=3))
    reference = live.body.reference(live.parameters)
    for row, nest in enumerate(made.layout.nest):
        for leg, extension in zip(live.legs, made.q[row] - reference, strict=True):
            leg.command(extension, 1.0)
        clock.advance(200.0)
        if nest in live.around.platform_nests:
            now = np.array([clock.now()])
            seen = live.distortions.seen(live.nest_in_tracker(nest, now), now)[0]
            assert made.xyz[row] == pytest.approx(seen, abs=2e-6)


@pytest.mark.parametrize("machine", ["hexapod", "tripod", "ptm"])
@pytest.mark.parametrize("seed", [1, 2])
def test_runs_of_every_machine_are_fitted_to_their_noise(machine: str, seed: int) -> None:
    made = simulate(RunPlan(machine=machine, seed=seed, poses=50, prior="normal"))
    described = load_machine(machine)
    parsed = parse_run(run_toml(made), points_csv(made), actuators=len(described.actuators))
    fit = fit_effects(stack(described, [parsed]), [])
    assert fit.bad == ()
    assert fit.chi2_per_dof == pytest.approx(1.0, abs=0.2)


def test_tracker_noise_is_as_its_covariance_says() -> None:
    clean = simulate(RunPlan(seed=8, poses=150, noise_mm=1e-9))
    noisy = simulate(RunPlan(seed=8, poses=150, noise_mm=None))
    rows = noisy.layout.reading
    xx, yy, zz, xy, xz, yz = noisy.covariance[rows].T
    cov = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    off = (noisy.xyz - clean.xyz)[rows]
    chi2 = np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off)
    assert np.mean(chi2) == pytest.approx(3.0, abs=0.3)
    assert 0.0025 < np.sqrt(xx.min()) < np.sqrt(xx.max()) < 0.005


def test_stray_readings_are_in_the_truth() -> None:
    made = simulate(RunPlan(seed=9, poses=20, strays=3))
    clean = simulate(RunPlan(seed=9, poses=20))
    bad = json.loads(truth_json(made))["bad_lines"]
    differ = np.flatnonzero(np.linalg.norm(np.nan_to_num(made.xyz - clean.xyz), axis=1) > 0.1)
    assert bad == [row + 2 for row in differ]
    assert len(bad) == 3


def test_poses_out_of_reach_are_refused() -> None:
    with pytest.raises(ValueError, match="out of reach"):
        simulate(RunPlan(poses=np.array([[0.0, 0.0, 400.0, 0.0, 0.0, 0.0]])))


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = tmp_path / "poses.csv"
    poses.write_text("pose,x,y,z,rx,ry,rz\na,1,2,221,0.05,0,0\nb,-1,-2,219,0,0.05,0\n")
    out, truth = tmp_path / "run", tmp_path / "truth.json"
    call = ["simulate", "hexapod", "--poses", str(poses), "--out", str(out), "--noise-um", "5"]
    assert run([*call, "--truth", str(truth), "--effect", "screw-twist.L=2.0", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["poses"], said["readings"]) == (2, 14)
    assert sorted(p.name for p in out.iterdir()) == ["points.csv", "run.toml"]
    assert json.loads(truth.read_text())["hidden"] == {"screw-twist.L": 2.0}
    assert (out / "points.csv").read_text().count("\n") == 1 + 1 + 8 + 6


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (["--effect", "screw-twist.M=2"], "no hidden effect"),
        (["--effect", "backlash.limb1=2"], "no hidden effect"),
        (["--effect", "backlash"], "NAME=VALUE"),
        (["--poses", "0"], "at least 1"),
        (["--poses", "none.csv"], "none.csv"),
        (["--noise-um", "-1"], "positive"),
    ],
)
def test_command_line_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: list[str], says: str
) -> None:
    assert run(["simulate", "hexapod", "--out", str(tmp_path / "run"), *wrong]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_command_line_writes_over_no_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["simulate", "hexapod", "--out", str(tmp_path / "run"), "--poses", "2"]
    assert run([*call, "--seed", "1"]) == 0
    before = (tmp_path / "run" / "points.csv").read_bytes()
    assert run([*call, "--seed", "2"]) == 2
    assert "a run already" in capsys.readouterr().err
    assert (tmp_path / "run" / "points.csv").read_bytes() == before
