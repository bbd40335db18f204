"""Gates and proposals as pure functions: what passes, what is refused, what is never written."""

from dataclasses import replace

import numpy as np
import pytest
from session_lab import lab_site

from app.errors import GateRefused
from app.files.fits import SavedFit
from app.files.machines import load_machine
from app.session.path import check_waypoints
from app.session.station import Station
from app.writeback.gates import Gates, gates_of_check, gates_of_proposal, refuse_if_any
from app.writeback.procedure import check_poses
from app.writeback.proposal import Change, propose
from calib.errors import BadInput
from calib.pose_error import Summary
from calib.poses import verification_poses
from calib.unknown import Estimate, Unknown

MACHINE = load_machine("hexapod")
NOMINAL = {p.name: p.nominal for p in MACHINE.parameters}
COMPENSATION = {
    f"{effect}.leg{i}": 0.0 for effect in ("backlash", "screw-pitch") for i in range(1, 7)
}
TABLE = {f"screw-cyclic-table.leg1.{k}": 0.0 for k in ("period", *range(8))}
HELD = {**NOMINAL, **COMPENSATION, **TABLE}
GATES = Gates.with_limits({})


def made(effects: tuple[str, ...] = (), sigma: float = 5e-3, **changes: float) -> SavedFit:
    """A fit near nominal, with ``changes`` by parameter name (dots as ``__``)."""
    values = {**NOMINAL, "leg1.L0": NOMINAL["leg1.L0"] + 0.1}
    values |= {name.replace("__", "."): value for name, value in changes.items()}
    estimates = {n: Estimate(Unknown(n, "mm"), v, sigma) for n, v in values.items()}
    quality = {"chi2_per_dof": 1.0, "holdout_rms_um": 9.0, "holdout_floor_um": 9.0}
    covariance = sigma**2 * np.eye(len(estimates))
    return SavedFit("made.toml", "hexapod", effects, estimates, quality, covariance, True)


def failed(fit: SavedFit, gates: Gates = GATES) -> list[str]:
    checked = gates_of_proposal(gates, MACHINE, fit, propose(MACHINE, fit, HELD), HELD)
    return [gate.gate for gate in checked if not gate.passed]


def test_a_fit_that_is_held_but_for_rounding_changes_nothing() -> None:
    fit = made(leg1__L0=NOMINAL["leg1.L0"] + 1e-6)
    assert not propose(MACHINE, fit, HELD).changes_something
    assert propose(MACHINE, made(), HELD).changes_something
    assert propose(MACHINE, made(leg3__B_x=float("nan")), HELD).changes_something


def test_a_sane_fit_passes_every_gate() -> None:
    assert failed(made()) == []


@pytest.mark.parametrize(
    ("fit", "gate"),
    [
        (made(leg3__B_x=float("nan")), "finite"),
        (made(leg3__B_x=NOMINAL["leg3.B_x"] + 2.0), "tolerance"),
        (replace(made(), quality={**made().quality, "chi2_per_dof": 9.0}), "chi2"),
        (replace(made(), quality={**made().quality, "holdout_rms_um": 30.0}), "holdout"),
        (replace(made(), quality={}), "chi2"),
        (made(sigma=0.2), "uncertainty"),
        (replace(made(leg1__L0=NOMINAL["leg1.L0"])), "gain"),
    ],
)
def test_what_is_not_sane_is_refused_by_its_gate(fit: SavedFit, gate: str) -> None:
    assert gate in failed(fit)


@pytest.mark.parametrize("over", [1.9, 2.1])
def test_poses_not_seen_may_err_twice_as_much_as_a_perfect_model_shows(over: float) -> None:
    fit = made()
    fit = replace(fit, quality={**fit.quality, "holdout_rms_um": over * 9.0})
    assert failed(fit) == (["holdout"] if over > 2.0 else [])


@pytest.mark.parametrize(
    ("measured", "answers", "passes"),
    [("17", "17", True), ("17", "18", False), ("", "18", True), ("17", "", True)],
)
def test_a_fit_of_another_machine_of_the_type_is_refused(
    measured: str, answers: str, passes: bool
) -> None:
    fit = replace(made(), controller_serial=measured)
    proposal = propose(MACHINE, fit, HELD)
    checked = gates_of_proposal(GATES, MACHINE, fit, proposal, HELD, serial=answers)
    assert [gate.gate for gate in checked if not gate.passed] == ([] if passes else ["machine"])
    assert passes or "18 answers" in checked[0].says


def test_a_change_is_told_in_standard_uncertainties() -> None:
    change = Change("leg1.L0", 230.0, 230.1, 0.02, "mm", True)
    assert change.in_sigmas == pytest.approx(5.0)
    assert np.isnan(replace(change, sigma=0.0).in_sigmas)


def test_parameters_that_leave_the_workspace_are_refused() -> None:
    far = {f"leg{i}__B_z": -8.0 for i in range(1, 7)}
    assert "workspace" in failed(made(**far), Gates.with_limits({"tolerance": 1e3}))


def test_a_single_pose_that_is_lost_is_one_too_many() -> None:
    assert GATES.check("workspace", 0.0, "", "outside").passed
    assert not GATES.check("workspace", 1.0, "", "outside").passed


@pytest.mark.parametrize("machine", ["hexapod", "delta"])
def test_check_poses_are_eight_of_the_grid_and_spread_over_its_places(machine: str) -> None:
    known = load_machine(machine)
    chosen = check_poses(Station(replace(lab_site(), machine=known)))
    grid = verification_poses(known).by_label
    assert chosen.items() <= grid.items()
    assert len(chosen) == 8
    places = [np.array(list(poses.values()))[:, :3] for poses in (chosen, grid)]
    assert np.all(np.ptp(places[0], axis=0) >= 0.99 * np.ptp(places[1], axis=0))
    assert len(np.unique(places[0].round(6), axis=0)) == 8
    path = [known.home, *chosen.values(), known.home]
    assert check_waypoints(known, {}, path, ["home", *chosen, "home"]) > 0.0


@pytest.mark.parametrize(("scale", "worse"), [(0.8, 1.255), (1.1, 0.908)])
def test_only_parameters_that_are_nearer_to_a_singularity_are_refused_for_it(
    scale: float, worse: float
) -> None:
    """A smaller circle of joints on the platform holds it less well, a larger one better."""
    places = [f"leg{i}.P_{axis}" for i in range(1, 7) for axis in "xy"]
    fit = made(**{name.replace(".", "__"): scale * NOMINAL[name] for name in places})
    gates = Gates.with_limits({"condition": 1.2, "tolerance": 1e6, "gain": 1e6})
    checked = gates_of_proposal(gates, MACHINE, fit, propose(MACHINE, fit, HELD), HELD)
    condition = next(gate for gate in checked if gate.gate == "condition")
    assert condition.value == pytest.approx(worse, abs=2e-3)
    assert condition.passed is (worse < 1.2)


def test_a_limit_can_be_changed_knowingly_but_not_mistyped() -> None:
    fit = replace(made(), quality={**made().quality, "chi2_per_dof": 9.0})
    assert failed(fit, Gates.with_limits({"chi2": 10.0})) == []
    with pytest.raises(BadInput, match="no gate"):
        Gates.with_limits({"chi": 10.0})


def test_effects_of_the_measurement_are_never_written() -> None:
    fit = made(
        ("tracker-scale", "backlash", "gravity-sag"),
        **{"tracker-scale.k": 1e-5, "gravity-sag.c": 1e-4},
        **{f"backlash.leg{i}": 0.01 for i in range(1, 6)},
        **{"backlash.leg6": -0.0003},
    )
    proposal = propose(MACHINE, fit, HELD)
    assert set(proposal.left_out) == {"tracker-scale", "gravity-sag"}
    assert not [n for n in proposal.values if n.startswith(("tracker", "gravity", "frame"))]
    assert proposal.values["backlash.leg1"] == 0.01
    assert proposal.values["backlash.leg6"] == 0.0  # lost motion is never negative


def test_what_the_controller_compensated_meanwhile_is_added_to() -> None:
    found = made(("screw-pitch",), **{f"screw-pitch.leg{i}": 1e-4 for i in range(1, 7)})
    used = {"screw-pitch.leg2": 2e-4}
    fit = replace(found, compensation=used)
    values = propose(MACHINE, fit, {**HELD, **used}).values
    assert values["screw-pitch.leg1"] == 1e-4
    assert values["screw-pitch.leg2"] == pytest.approx(3e-4)
    again = propose(MACHINE, fit, {**HELD, **values})
    assert all(change.new == change.old for change in again.changes)


def test_a_fit_that_is_silent_about_compensation_is_not_added() -> None:
    fit = made(("screw-pitch",), **{f"screw-pitch.leg{i}": 1e-4 for i in range(1, 7)})
    proposal = propose(MACHINE, fit, {**HELD, "screw-pitch.leg2": 2e-4})
    assert "fit --save" in proposal.left_out["screw-pitch"]


def test_a_cyclic_error_becomes_a_table() -> None:
    fit = made(
        ("screw-cyclic",),
        **{
            "screw-cyclic.leg1.sin": 0.01,
            "screw-cyclic.leg1.cos": 0.0,
            "screw-cyclic.period": 5.0,
        },
    )
    values = propose(MACHINE, fit, HELD).values
    assert values["screw-cyclic-table.leg1.period"] == 5.0
    table = [values[f"screw-cyclic-table.leg1.{k}"] for k in range(8)]
    assert table == pytest.approx(list(0.01 * np.sin(np.arange(8) * np.pi / 4)))


@pytest.mark.parametrize(
    ("searched", "held"),
    [({}, HELD), ({"screw-cyclic.period": 5.0}, {**NOMINAL, **COMPENSATION})],
    ids=["no period", "no table"],
)
def test_a_cyclic_error_needs_its_period_and_a_table_in_the_controller(
    searched: dict[str, float], held: dict[str, float]
) -> None:
    waves = {"screw-cyclic.leg1.sin": 0.01, "screw-cyclic.leg1.cos": 0.0}
    proposal = propose(MACHINE, made(("screw-cyclic",), **waves, **searched), held)
    assert "no cyclic table" in proposal.left_out["screw-cyclic"]
    assert all(change.new == change.old for change in proposal.changes if "cyclic" in change.name)


def test_a_fit_of_another_machine_or_of_53_parameters_is_refused() -> None:
    with pytest.raises(BadInput, match="tripod"):
        propose(MACHINE, replace(made(), machine="tripod"), HELD)
    fit = made()
    less = {n: e for n, e in fit.estimates.items() if n != "leg6.L_P"}
    with pytest.raises(BadInput, match=r"leg6\.L_P"):
        propose(MACHINE, replace(fit, estimates=less), HELD)


@pytest.mark.parametrize(
    ("peak", "noise", "beyond", "passed"),
    [
        (65.0, 9.0, 56.0, True),
        (65.0, 0.0, 65.0, False),
        (75.0, 9.0, 66.0, False),
        (5.0, 9.0, 0.0, True),
    ],
)
def test_check_peak_counts_what_is_beyond_the_trackers_noise(
    peak: float, noise: float, beyond: float, passed: bool
) -> None:
    before, after = (
        Summary(400.0, 10.0, 300.0, 0.1, 0.01, 0.05),
        Summary(peak, 2.0, 6.0, 0.0, 0.0, 0.0),
    )
    gate = gates_of_check(GATES, before, after, noise)[0]
    assert (gate.gate, gate.value, gate.passed) == ("check-peak", beyond, passed)


def test_check_poses_must_be_good_and_better() -> None:
    before = Summary(400.0, 10.0, 300.0, 0.1, 0.01, 0.05)
    good = Summary(12.0, 2.0, 6.0, 0.005, 0.001, 0.003)
    assert all(gate.passed for gate in gates_of_check(GATES, before, good, 9.0))
    worse = replace(before, position_rms_um=310.0)
    checked = gates_of_check(GATES, before, worse, 9.0)
    assert [gate.gate for gate in checked if not gate.passed] == ["check-peak", "check-rms"]
    with pytest.raises(GateRefused, match="check-peak"):
        refuse_if_any(checked, "measure more")


@pytest.mark.parametrize(
    ("now", "apart"),
    [
        ({"pivot": "0 0 0", "system": "ZERO", "rotation": "zyx"}, 0),
        ({"pivot": "0.0 0.0 0.0", "system": "ZERO"}, 0),
        ({"pivot": "0 0 50", "system": "ZERO"}, 1),
        ({"pivot": "0 0 50", "system": "LAB"}, 2),
        ({}, 0),
    ],
)
def test_poses_that_refer_to_something_else_than_when_it_was_measured_are_refused(
    now: dict[str, str], apart: int
) -> None:
    frame = {"pivot": "0 0 0", "system": "ZERO", "rotation": "zyx"}
    fit = replace(made(), controller_frame=frame)
    proposal = propose(MACHINE, fit, HELD)
    checked = gates_of_proposal(GATES, MACHINE, fit, proposal, HELD, frame=now)
    refused = [gate for gate in checked if not gate.passed]
    assert [gate.gate for gate in refused] == ["frame"] * bool(apart)
    if apart:
        assert "pivot was 0 0 0, and is 0 0 50" in refused[0].says
        assert refused[0].value == apart


@pytest.mark.parametrize(
    ("effect", "reason"),
    [
        ("tracker-scale", "of the measurement"),
        ("actuator-step", "it happened in that run"),
        ("bent-rail", "your own"),
        ("gravity-sag", "no compensation for it"),
    ],
)
def test_what_is_not_written_says_exactly_why(effect: str, reason: str) -> None:
    left_out = propose(MACHINE, made(effects=(effect,)), HELD).left_out
    assert reason in left_out[effect]
