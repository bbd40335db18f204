"""A known model on readings that it has not seen: its covariance, its frame, what it says."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.cli import run
from app.jobs.predicting import PredictReport
from calib.errors import BadInput
from tests.answers import faults_of


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of one run; runs of the same machine, unchanged and with lost motion."""
    folder = tmp_path_factory.mktemp("lab")
    pkmcal.simulate("tripod", folder / "first", seed=3, poses=20, truth=folder / "truth.json")
    truth = json.loads((folder / "truth.json").read_text())
    (folder / "true.json").write_text(json.dumps(truth["parameters"]))
    same = {"seed": 4, "poses": 12, "parameters": folder / "true.json"}
    pkmcal.simulate("tripod", folder / "again", **same)
    pkmcal.simulate("tripod", folder / "worn", effects={"backlash.limb2": 0.05}, **same)
    pkmcal.fit(folder / "first").save(folder / "model.toml")
    return folder


@pytest.fixture(scope="module")
def again(lab: Path) -> PredictReport:
    return pkmcal.predict(lab / "model.toml", lab / "again", frame=True)


def test_a_machine_that_has_not_changed_is_predicted_as_well_as_expected(
    again: PredictReport,
) -> None:
    assert again.p_value > 1e-3
    assert 0.7 < again.ratio < 1.3
    assert again.expected_um > 0.9 * again.noise_um
    assert "as near to the model" in again.advice


def test_lost_motion_since_then_is_told(lab: Path) -> None:
    worn = pkmcal.predict(lab / "model.toml", lab / "worn", frame=True)
    assert worn.p_value < 1e-9
    assert worn.ratio > 1.5
    assert "the machine has changed" in worn.advice


def test_a_tracker_that_was_moved_is_told_and_the_frame_is_fitted_only_if_asked(lab: Path) -> None:
    found = pkmcal.predict(lab / "model.toml", lab / "again")
    assert found.frame == "of the model"
    assert any("--frame" in one for one in found.remarks)
    assert found.rms_um > 1e3


@pytest.mark.parametrize(
    ("name", "then", "now"),
    [
        ("frame-shift", {"x": 0.3, "t0": 500.0, "where": 1.0}, {}),
        ("tracker-drift", {"vx": 0.2}, {"vx": -0.1, "wz": 5e-5}),
    ],
)
def test_what_happened_in_the_runs_of_the_model_is_not_carried_to_others(
    lab: Path, tmp_path: Path, name: str, then: dict[str, float], now: dict[str, float]
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    for folder, seed, hidden in ((first, 5, then), (second, 6, now)):
        pkmcal.simulate(
            "tripod", folder, seed=seed, poses=20, parameters=lab / "true.json",
            effects={f"{name}.{key}": value for key, value in hidden.items()},
        )  # fmt: skip
    pkmcal.fit(first, add=[name]).save(tmp_path / "model.toml")
    found = pkmcal.predict(tmp_path / "model.toml", second, frame=True)
    assert found.p_value > 1e-3
    assert found.rms_um < 1.5 * found.noise_um + 5.0
    assert any(one.startswith(f"{name}: ") for one in found.remarks)


def test_covariance_by_blocks_is_that_of_the_whole(again: PredictReport) -> None:
    found = again._found
    p = found.linear.jacobian.shape[0] - 6
    J = found.spread[:, :, found.accepted].reshape(found.spread.shape[0], -1)
    F = found.linear.jacobian[p:, :, found.accepted].reshape(6, -1)
    left = np.eye(F.shape[1]) - F.T @ np.linalg.solve(F @ F.T, F)
    whole = left @ (np.eye(F.shape[1]) + J.T @ J) @ left
    factors = np.moveaxis(found.model.rows.unwhitener[:, :, found.accepted], -1, 0)
    count = factors.shape[0]
    blocks = whole.reshape(3, count, 3, count)
    for k in (0, count // 2, count - 1):
        block = factors[k] @ blocks[:, k, :, k] @ factors[k].T
        at = np.flatnonzero(found.accepted)[k]
        assert np.allclose(found.covariance[:, :, at], block, rtol=1e-6, atol=1e-12)
    e = found.linear.whitened[:, found.accepted].reshape(-1)
    assert np.allclose(F @ e, 0.0, atol=1e-3 * np.linalg.norm(F, axis=1).max())
    inverse = np.linalg.pinv(whole, rcond=1e-9)
    assert found.chi2 == pytest.approx(float(e @ inverse @ e), rel=1e-6)


def test_residuals_are_written_of_every_reading(lab: Path, again: PredictReport) -> None:
    again.residuals(lab / "residuals.csv")
    with (lab / "residuals.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == again._found.model.rows.count
    um = np.array([[float(line[f"d{c}_um"]) for c in "xyz"] for line in lines])
    base = np.array([[float(line[f"base_d{c}_um"]) for c in "xyz"] for line in lines])
    platform = np.array([line["on"] == "platform" for line in lines])
    rms = float(np.sqrt(np.mean(np.sum(um[platform] ** 2, axis=1))))
    assert rms == pytest.approx(again.rms_um, rel=1e-4)
    assert np.allclose(np.linalg.norm(um, axis=1), np.linalg.norm(base, axis=1), atol=1e-3)
    for axis in again.axes:
        mine = base[platform, "xyz".index(axis.axis)]
        assert axis.mean_um == pytest.approx(float(mine.mean()), abs=1e-3)


@pytest.mark.parametrize("verb", ["fit", "diagnose"])
def test_verbs_write_residuals_of_their_fit(lab: Path, tmp_path: Path, verb: str) -> None:
    file = tmp_path / "residuals.csv"
    assert run([verb, str(lab / "first"), "--residuals", str(file), "--json"]) == 0
    with file.open() as opened:
        lines = list(csv.DictReader(opened))
    assert len(lines) == pkmcal.load_runs(lab / "first").count
    assert all(line["left_out"] == "" for line in lines)


def test_predict_answers_by_its_schema_and_in_words(
    lab: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["predict", str(lab / "model.toml"), str(lab / "again"), "--frame"]
    assert run([*words, "--json"]) == 0
    assert faults_of(json.loads(capsys.readouterr().out)) == []
    assert run(words) == 0
    told = capsys.readouterr().out
    assert "expected" in told
    assert "-0.00" not in told


def test_what_cannot_be_predicted_is_refused(lab: Path, tmp_path: Path) -> None:
    other = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
    with pytest.raises(BadInput, match="hexapod"):
        pkmcal.predict(lab / "model.toml", other)
    pkmcal.fit([lab / "first", lab / "again"]).save(tmp_path / "two.toml")
    with pytest.raises(BadInput, match="several runs"):
        pkmcal.predict(tmp_path / "two.toml", lab / "again")
    assert run(["predict", str(lab / "model.toml"), str(lab / "again"), "--out",
                str(lab / "again" / "residuals.csv")]) == 2  # fmt: skip


def test_readings_of_every_kind_are_predicted_and_their_frames_fitted(tmp_path: Path) -> None:
    from app.files.residuals import residuals_text
    from calib.identify import fit
    from calib.identify.predicting import Known, predict
    from calib.model.prediction import Model
    from tests.kinds.conftest import everything, load, rows_of

    machine = load("hexapod")
    lab = everything(machine, seed=5)
    rows = rows_of(machine, lab)
    found = fit(Model(rows))
    known = Known(found.values, found.covariance)
    as_it_is = predict(Model(rows), known, refit=False)
    assert np.allclose(as_it_is.linear.whitened, found.linear.whitened, atol=1e-6)
    again = predict(Model(rows), known, refit=True)
    assert again.dof == as_it_is.dof - 6 * again.model.frames
    held = again.accepted
    assert np.sum(again.linear.whitened[:, held] ** 2) <= 1.001 * np.sum(
        as_it_is.linear.whitened[:, held] ** 2
    )
    text = residuals_text(again.model, again.linear, {})
    kinds = {line["kind"] for line in csv.DictReader(text.splitlines())}
    assert {"point", "angles", "distance"} <= kinds
    for name, written in zip(("run.toml", "points.csv"), lab.texts(), strict=True):
        (tmp_path / name).write_text(written)
    pkmcal.fit(tmp_path).save(tmp_path.parent / "kinds.toml")
    report = pkmcal.predict(tmp_path.parent / "kinds.toml", tmp_path)
    assert report.ratio < 1.2
    assert report.p_value > 0.5
    assert faults_of(report.to_json()) == []
