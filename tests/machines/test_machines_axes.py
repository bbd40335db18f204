"""Laws of the axes: names that are unique, every error in its own axis's unit, over any machine."""

import json
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from made_machines import GANTRY, LEAD_MM, delta_text, gantry, screw_delta, screw_delta_text

from app.cli import run
from app.files.fits import read_fit
from app.files.machines import load_machine, shipped_machines
from app.files.runs import read_run
from calib.discover.problem import variables_of
from calib.discover.terms import library
from calib.effects import catalogue, effect_named
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.identify import fit
from calib.mechanism.axes import axes_of
from calib.mechanism.description import Actuator, Element, Limb, Machine, Term
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import within_limits
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward, inverse
from calib.model import Model
from calib.runs.stack import stack

SHIPPED = shipped_machines()
MADE = {"gantry": gantry, "screw-delta": screw_delta}
TEXTS = {"gantry": GANTRY, "screw-delta": screw_delta_text()}
LOAD = "\n[load]\nplatform_mass_kg = 8.0\nplatform_com = [10.0, 0.0, 50.0]\n"
RATIO = LEAD_MM / (2.0 * np.pi)


def machine_named(name: str) -> Machine:
    return MADE[name]() if name in MADE else load_machine(name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("made")


@pytest.fixture(scope="module")
def run_of(folder):
    """A simulated run by machine: its folder."""

    @cache
    def make(name: str) -> Path:
        named = name
        if name in TEXTS:
            named = str(folder / f"{name}.toml")
            Path(named).write_text(TEXTS[name])
        out = folder / f"run-{name}"
        assert run(["simulate", named, "--out", str(out), "--poses", "16", "--json"]) == 0
        header = out / "run.toml"
        header.write_text(header.read_text() + LOAD)
        return out

    return make


@pytest.fixture(scope="module")
def rows_of(run_of):
    @cache
    def make(name: str):
        loaded = read_run(run_of(name))
        return stack(loaded.machine, [loaded.run])

    return make


@pytest.mark.parametrize("name", [*SHIPPED, *MADE])
def test_names_of_axes_are_unique(name):
    axes = machine_named(name).axes
    assert len({axis.name for axis in axes}) == len(axes)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("hexapod", [f"leg{k}" for k in range(1, 7)]),
        ("tripod", ["limb1", "limb2", "limb3"]),
        ("ptm", ["limb1", "limb2"]),
        ("delta", ["tower1", "tower2", "tower3"]),
        ("arm", [f"q{k}" for k in range(1, 7)]),
        ("gantry", list("uvwabc")),
        ("screw-delta", ["tower1", "tower2", "tower3"]),
    ],
)
def test_an_axis_is_called_after_its_limb_where_it_is_alone_there(name, expected):
    assert [axis.name for axis in machine_named(name).axes] == expected


def test_a_limb_that_is_called_as_another_limbs_actuator_leaves_the_names_unique():
    def driven(*which: int) -> tuple[Element, ...]:
        return tuple(Element(False, 0, terms=(Term("actuator", k, 1.0),)) for k in which)

    limbs = [Limb("q2", driven(0), (), 0), Limb("both", driven(1, 2), (), 0)]
    actuators = [Actuator(f"q{k}", "mm", 0.0, (-1.0, 1.0), 0.0) for k in (1, 2, 3)]
    assert [axis.name for axis in axes_of(actuators, limbs)] == ["q1", "q2", "q3"]


@pytest.mark.parametrize("name", ["arm", "gantry", "screw-delta"])
def test_unknowns_of_all_effects_are_unique(rows_of, name):
    rows = rows_of(name)
    effects = [effect for effect in catalogue(rows.machine) if not effect.unavailable(rows)]
    counts = Counter(u.name for effect in effects for u in effect.unknowns(rows))
    assert max(counts.values()) == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "effect"),
    [
        *product(["arm", "gantry", "screw-delta"], ["backlash", "screw-cyclic", "screw-pitch"]),
        *product(["gantry"], ["encoder-cyclic", "gravity-sag", "settling"]),
    ],
)
def test_what_is_saved_is_read_back(run_of, tmp_path, capsys, name, effect):
    source = run_of(name)
    capsys.readouterr()  # where the run has only now been made, that was said too
    saved = tmp_path / "model.toml"
    assert run(["fit", str(source), "--add", effect, "--save", str(saved), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["parameters"]
    names = [entry["name"] for entry in told]
    assert len(set(names)) == len(names)
    found = read_fit(saved)
    assert list(found.estimates) == names
    for entry in told:
        assert found.estimates[entry["name"]].value == pytest.approx(entry["value"], rel=1e-9)
        assert found.estimates[entry["name"]].unit == entry["unit"]
    assert run(["fit", str(source), "--model", str(saved), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["effects"] == [effect]


def test_every_axis_of_a_mixed_machine_errs_in_its_own_unit(rows_of):
    rows = rows_of("gantry")
    units = {axis.name: axis.unit for axis in rows.machine.axes}
    for effect in ("backlash", "screw-cyclic", "encoder-cyclic"):
        for unknown in effect_named(effect, rows.machine).unknowns(rows):
            if not unknown.nonlinear:
                assert unknown.unit == units[unknown.name.split(".")[1]], unknown.name
    assert [(u.name, u.unit) for u in effect_named("gravity-sag", rows.machine).unknowns(rows)] == [
        ("gravity-sag.c_linear", "mm/N"),
        ("gravity-sag.c_rotary", "rad/(N mm)"),
    ]
    linear, rotary = (effect_named(e, rows.machine) for e in ("screw-cyclic", "encoder-cyclic"))
    assert {u.unit for u in linear.unknowns(rows)} == {"mm"}
    assert {u.unit for u in rotary.unknowns(rows)} == {"rad"}
    assert {round(t[0], 6) for t in linear.trials(rows)} >= {1.0, 25.0}
    assert max(t[0] for t in rotary.trials(rows)) == pytest.approx(2.0 * np.pi)
    assert min(t[0] for t in rotary.trials(rows)) == pytest.approx(2.0 * np.pi / 200.0)


def test_structure_of_a_mixed_machine_goes_by_the_units_of_its_axes(rows_of):
    found = fit(Model(rows_of("gantry")))
    variables = {variable.name: variable for variable in variables_of(found)}
    for number, axis in enumerate(found.model.machine.axes):
        variable = variables[f"q{number + 1}"]
        assert variable.shortest == axis.shortest
        assert variable.responses[0].scale(0) == (axis.unit, axis.usual_error)
        assert variables["direction"].responses[0].scale(number) == (axis.unit, axis.usual_error)


def test_formulas_of_a_mixed_machine_are_of_one_unit_each(rows_of):
    rows = rows_of("gantry")
    found = fit(Model(rows))
    units = {axis.name: axis.unit for axis in rows.machine.axes}
    offered = [f for f in library(found) if f.acts_on == "actuator"]
    assert {f.axes for f in offered} == {("u", "v", "w"), ("a", "b", "c")}
    for formula in offered:
        effect = effect_from_text(formula.table("own", "a term", "abc"), "library")
        assert not effect.unavailable(rows)
        names = [u.name for u in effect.unknowns(rows) if not u.nonlinear]
        if not formula.shared:
            assert {name.split(".")[1] for name in names} == set(formula.axes)
        own = units[formula.axes[0]]
        for unit in formula.units:
            assert unit == "1" or unit.startswith((own, "1/"))
            # The pose, and the moment in an actuator that turns, bring units of their own.
            if not any(one in "".join(formula.text) for one in ("pose_", "force")):
                assert not any(other in unit for other in {"mm", "rad"} - {own})


def test_an_effect_file_that_names_axes_leaves_the_others_alone(rows_of):
    rows = rows_of("gantry")
    text = (
        '[effect]\nid = "own"\nexpression = "k * s**2"\n'
        'unknowns = { k = "1/rad" }\naxes = ["b", "c"]\n'
    )
    effect = effect_from_text(text, "own.toml")
    assert [u.name for u in effect.unknowns(rows)] == ["own.b.k", "own.c.k"]
    situation = fit(Model(rows)).linear.situation
    shape = effect.signature(situation, np.zeros(2)).extension
    assert shape is not None
    np.testing.assert_allclose(shape[0, 4], rows.extension[4] ** 2)
    shape[0, 4] = shape[1, 5] = 0.0
    assert not shape.any()
    assert "no-such" in effect_from_text(text.replace('"c"', '"no-such"'), "own.toml").unavailable(
        rows
    )


@pytest.mark.long
@pytest.mark.parametrize("name", MADE)
def test_columns_of_effects_agree_with_differences(rows_of, name):
    rows = rows_of(name)
    frames = fit(Model(rows)).linear.state
    generator = np.random.default_rng(7)
    for effect in catalogue(rows.machine):
        if effect.unavailable(rows) or effect.kind != "machine":
            continue
        model = Model(rows, [effect])
        group = model.unknowns[0]
        trials = list(effect.trials(rows))
        # Small: an effect's shape moves with the pose that it moves.
        values = np.array(
            [
                trials[len(trials) // 3][0] if u.nonlinear else 0.02 * u.size * generator.normal()
                for u in group
            ]
        )
        start = model.start(frames.frame_rotation, frames.frame_position)
        linear = model.linearise(replace(start, effects=(values,)))
        for index, unknown in enumerate(group):
            step = np.zeros(model.prior.size)
            size = 1e-4 * abs(values[index]) if unknown.nonlinear else 1e-3 * unknown.size
            step[model.free.size + index] = size
            ahead, back = (
                model.predict(model.moved(linear.state, sign * step)) for sign in (1.0, -1.0)
            )
            slope = np.einsum("ijn,jn->in", rows.whitener, ahead - back) / (2.0 * size)
            own = linear.jacobian[model.free.size + index]
            np.testing.assert_allclose(
                own, slope, atol=2e-3 * np.abs(own).max() + 1e-9, err_msg=unknown.name
            )


def test_a_motor_behind_a_screw_is_the_linear_axis_in_other_units():
    turning, sliding = screw_delta(), parse_machine(delta_text(), "delta.toml")
    target = np.array([[0.0, 25.0, -40.0], [0.0, -30.0, 10.0], [100.0, 60.0, 140.0]])
    there, here = inverse(turning, target), inverse(sliding, target)
    assert there.converged.all()
    np.testing.assert_allclose(RATIO * there.extension, here.extension, atol=1e-9)
    np.testing.assert_allclose(forward(turning, there.extension).poses.position, target, atol=1e-9)
    np.testing.assert_allclose(
        pose_jacobians(turning, there).actuators,
        RATIO * pose_jacobians(sliding, here).actuators,
        atol=1e-9,
    )
    np.testing.assert_allclose(RATIO * turning.q_limits, sliding.q_limits)
    far = np.array([[0.0], [0.0], [-60.0]])
    for machine in (turning, sliding):
        assert within_limits(machine, inverse(machine, target)).all()
        assert not within_limits(machine, inverse(machine, far)).any()


def test_usual_errors_behind_a_screw_are_those_of_the_carriage():
    for turning, sliding in zip(
        screw_delta().axes, parse_machine(delta_text(), "delta.toml").axes, strict=True
    ):
        assert (turning.unit, turning.moves) == ("rad", "mm")
        assert RATIO * turning.usual_error == pytest.approx(sliding.usual_error)
        assert RATIO * turning.lost_motion == pytest.approx(sliding.lost_motion)
        # F = Q / ratio and mm = ratio rad: a yield of rad per N mm.
        assert RATIO**2 * turning.compliance == pytest.approx(sliding.compliance)
        assert turning.shortest < 2.0 * np.pi < turning.longest


def test_lost_motion_of_a_motor_is_found_in_its_own_unit(rows_of):
    rows = rows_of("screw-delta")
    effect = effect_named("backlash", rows.machine)
    model = Model(rows, [effect])
    assert [u.unit for u in model.unknowns[0]] == ["rad"] * 3
    plain = fit(Model(rows)).linear
    lost = np.array([0.04, 0.0, -0.06])
    start = model.start(plain.state.frame_rotation, plain.state.frame_position)
    with_it = replace(start, parameters=plain.state.parameters, effects=(lost,))
    without = replace(with_it, effects=(np.zeros(3),))
    moved = model.predict(with_it) - model.predict(without)
    found = fit(Model(replace(rows, position=rows.position + moved), [effect]))
    own = slice(model.free.size, model.free.size + 3)
    before = fit(model)
    np.testing.assert_allclose(
        found.values[own] - before.values[own], lost, atol=0.05 * float(found.sigmas[own].max())
    )


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("q+zero", "q is in rad, a value in mm is needed"),
        ("2*q+zero", "in rad, a value in mm is needed"),
        ("5mm/mm*q+zero", "in rad, a value in mm is needed"),
        ("5mm/furlong*q+zero", "furlong"),
        ("zero*q", "product of two variables"),
        ("5mm/0turn*q+zero", "not finite"),
    ],
)
def test_a_coupling_that_does_not_fit_is_refused(value, words):
    text = screw_delta_text().replace(f"Tz:{LEAD_MM:g}mm/turn*q+zero", f"Tz:{value}")
    with pytest.raises(BadInput, match=words):
        parse_machine(text, "x.toml")


@pytest.mark.parametrize("value", ["lead*q+zero", "zero+q*lead"])
def test_a_coupling_may_stand_in_the_table_of_its_limb(value):
    text = screw_delta_text().replace(f"Tz:{LEAD_MM:g}mm/turn*q+zero", f"Tz:{value}")
    text = text.replace('type = "tower"', f'type = "tower"\nlead = "{LEAD_MM} mm/turn"')
    assert [axis.ratio for axis in parse_machine(text, "x.toml").axes] == pytest.approx([RATIO] * 3)


def test_limits_of_a_motor_behind_a_screw_are_said_in_turns(folder, run_of, capsys):
    run_of("screw-delta")
    capsys.readouterr()
    assert run(["machine", "check", str(folder / "screw-delta.toml")]) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("q1 "))
    assert line.split()[:4] == ["q1", "turn", "50.00", "96.00"]
