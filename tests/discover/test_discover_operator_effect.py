"""Operators' effect files: parsed safely, faults named with their place, derivatives exact."""

from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_runs
from calib.effects import effect_named
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.formulas.expression import linear_unknowns, parse_expression
from calib.identify import fit
from calib.model import Model
from calib.runs.stack import stack

FORMULAS = [
    "k * s**2",
    "-k*s + a*sin(2*pi*s/p)",
    "k*exp(-t/tau)*(1 - a/(1 + s**2))",
    "sqrt(abs(k)) * cos(a)**3 / (2.5e-1 + tanh(tau*s))",
    "k**a - a**2 * log(p) - -2**2 * atan(s)",
    "where(s > 0, k * s, a * s**2) + max(k * s, p, -a) - min(tau, k) * step(t - 1) * (t <= 2)",
]
NAMES = ("k", "a", "p", "tau")
FILE = """
[effect]
id = "screw-quadratic"
says = "the screw's pitch changes along its length"
acts_on = "actuator"
expression = "k * s**2"
unknowns = { k = "1/mm" }
"""


def values(rng):
    given = {name: np.asarray(rng.uniform(0.5, 2.0)) for name in NAMES}
    return {**given, "s": rng.normal(size=7), "t": rng.uniform(0.0, 3.0, 7)}


@pytest.mark.parametrize("formula", FORMULAS)
def test_derivatives_agree_with_central_differences(formula):
    expression = parse_expression(formula, "test")
    given = values(np.random.default_rng(5))
    _, slopes = expression.evaluate(given, frozenset(NAMES))
    for name in set(NAMES) & set(expression.names):
        high, low = ({**given, name: given[name] + h} for h in (1e-6, -1e-6))
        difference = (
            expression.evaluate(high, frozenset())[0] - expression.evaluate(low, frozenset())[0]
        )
        np.testing.assert_allclose(
            slopes[name] * np.ones(7), difference / 2e-6, rtol=2e-8, atol=1e-8
        )


@pytest.mark.parametrize("which", ['"leg4"', "'leg4'", "leg4"])
def test_an_actuator_is_named_with_quotation_marks_or_without(which):
    assert parse_expression(f"k * s[{which}]", "test").names == {"k": 1, "s[leg4]": 5}


@pytest.mark.parametrize("formula", FORMULAS[:3])
def test_values_agree_with_the_same_formula_in_python(formula):
    given = values(np.random.default_rng(6))
    functions = {name: getattr(np, name) for name in ("sin", "cos", "exp", "sqrt", "abs")}
    expected = eval(formula, {"__builtins__": {}, "pi": np.pi, **functions}, given)
    found, _ = parse_expression(formula, "test").evaluate(given, frozenset())
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("formula", "column"),
    [
        ("k * s.real", 6),
        ("k * __import__('os')", 5),
        ("k * (s + 1", 11),
        ("k * foo(s)", 5),
        ("k * s s", 7),
        ("k * s[0]", 6),
        ("k * sin", 5),
        ("k *", 4),
        ("lambda: k", 7),
        ("k ^ 2", 3),
        ("k * sin(s, t)", 10),
        ("k * x[1]", 6),
        ("k * where(s, 1)", 15),
        ("k * nest(3)", 10),
        ("k * (s < 1 < 2)", 12),
        ("k + 9**9**9**9", 9),
        ("k * 1e308 * 10", 5),
        ("+".join("k" * 900), 801),
    ],
)
def test_fault_is_named_with_its_column(formula, column):
    with pytest.raises(BadInput, match=rf"column {column} of the expression") as caught:
        parse_expression(formula, "my.toml, line 3")
    assert "my.toml, line 3" in str(caught.value)


@pytest.mark.parametrize(
    "formula",
    ["(" * 5000 + "k", "(" * 10_000, "(" * 200 + "k" + ")" * 200, "2**" * 300 + "k", ""],
)
def test_hostile_formulas_end_in_clear_words(formula):
    with pytest.raises(BadInput):
        parse_expression(formula, "test")


def test_endless_signs_do_no_harm():
    found, _ = parse_expression("-" * 1001 + "1", "test").evaluate({}, frozenset())
    assert found == -1.0


@pytest.mark.parametrize(
    ("formula", "linear"),
    [
        ("k * s**2 + a * s", ("k", "a")),
        ("k * exp(-t / tau)", ("k",)),
        ("k * a * s", ("k",)),
        ("k * sin(2*pi*s/p + a)", ("k",)),
        ("k**2 + a", ("a",)),
        ("k / (1 + a) + tau", ("k", "tau")),
        ("where(s > p, k * s, a)", ("k", "a")),
        ("k * max(0, s - p) + a * step(t - tau)", ("k", "a")),
    ],
)
def test_linear_unknowns_are_recognised(formula, linear):
    assert linear_unknowns(parse_expression(formula, "test"), NAMES) == linear


def edited(old, new):
    assert old in FILE
    return FILE.replace(old, new)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        (edited("k * s**2", "k * s** 2)"), "line 6", "column 10"),
        (edited('k = "1/mm"', 'k = 3'), "line 7", "k is 3"),
        (edited('"k * s**2"', '"k * s**2 + 0.1"'), "line 6", "without a linear unknown"),
        (edited('k = "1/mm"', 'k = "1/mm", b = "1"'), "line 7", "'b' is not in the expression"),
        (edited("k * s**2", "sin(k * s)"), "line 7", "not linear in 'k'"),
        (edited('k = "1/mm"', 's = "1/mm"'), "line 7", "cannot be called 's'"),
        (edited('acts_on = "actuator"', 'acts_on = "leg"'), "line 5", "acts_on is 'leg'"),
        (edited('acts_on = "actuator"', "colour = 1"), "line 5", "unknown key \"colour\""),
        (edited('id = "screw-quadratic"', 'id = "My Effect"'), "line 3", "id is"),
        ("[effect", "line 1", "not valid TOML"),
        ("a = 1", "e.toml", "no table"),
    ],
)  # fmt: skip
def test_fault_of_a_file_is_named_with_its_line(text, place, words):
    with pytest.raises(BadInput) as caught:
        effect_from_text(text, "e.toml")
    assert place in str(caught.value)
    assert words in str(caught.value)


@pytest.fixture(scope="module")
def situation():
    """The example run without an effect, at the fit of its geometry."""
    folder = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
    loaded = read_runs((str(folder),))
    rows = stack(loaded[0].machine, [one.run for one in loaded])
    return fit(Model(rows)).linear.situation


def described(expression, unknowns, acts_on="actuator", more=""):
    return effect_from_text(
        f'[effect]\nid = "own"\nacts_on = "{acts_on}"\nexpression = {expression}\n'
        f"unknowns = {unknowns}\n{more}",
        "own.toml",
    )


def check_derivatives(effect, situation, rng):
    """Columns of linear unknowns do not depend on them; those of searched ones are derivatives."""
    rows = situation.rows
    assert effect.unavailable(rows) == ""
    unknowns = effect.unknowns(rows)
    trial = next(effect.trials(rows))
    count = len(unknowns) - len(trial)
    sizes = np.array([unknown.size for unknown in unknowns])
    values = np.concatenate([rng.normal(size=count) * sizes[:count], trial])

    def change(at):
        signature = effect.signature(situation, at)
        columns = signature.extension if effect.acts_on == "actuator" else signature.point
        columns = signature.nest if columns is None else columns
        return columns, np.tensordot(at[:count], columns[:count], axes=1)

    columns, _ = change(values)
    for index, value in enumerate(values):
        step = 1e-5 * max(abs(value), sizes[index])
        high, low = values.copy(), values.copy()
        high[index] += step
        low[index] -= step
        difference = (change(high)[1] - change(low)[1]) / (2 * step)
        scale = np.abs(columns[index]).max()
        np.testing.assert_allclose(difference, columns[index], atol=1e-7 * scale + 1e-12)


@pytest.mark.parametrize(
    ("expression", "unknowns", "acts_on", "more"),
    [
        ('"k * s**2"', '{ k = "1/mm" }', "actuator", ""),
        ('"k * s**2 + c * direction"', '{ k = "1/mm", c = "mm" }', "actuator", ""),
        ('"k * q1 * (structure_temp_C - 20)"', '{ k = "1/K" }', "actuator", "shared = true"),
        ('"k * exp(-t / tau)"', '{ k = "mm", tau = { unit = "s", from = 10, to = 1000 } }',
         "actuator", ""),
        ('"k * range"', '{ k = "1" }', "point", ""),
        ('"k * max(0, s - s0) + c * way"',
         '{ k = "1", c = { unit = "1", shared = true }, s0 = { unit = "mm", from = 1, to = 9 } }',
         "actuator", ""),
        ('"k * s[leg4] * pose_rz + c * exp(-since / tau)"',
         '{ k = "1/rad", c = "mm", tau = { unit = "s", from = 10, to = 1000 } }', "actuator", ""),
        ('["k * nest(\\"3\\")", "k * direction2", "c * pose_x"]', '{ k = "mm", c = "1" }',
         "point", 'frame = "base"'),
        ('["k * x", "k * y", "c * sin(2*pi*azimuth/p)"]',
         '{ k = "1", c = "mm", p = { unit = "rad", from = 1, to = 7 } }', "point", ""),
    ],
)  # fmt: skip
def test_signatures_are_derivatives(situation, expression, unknowns, acts_on, more):
    effect = described(expression, unknowns, acts_on, more)
    check_derivatives(effect, situation, np.random.default_rng(3))


def test_same_as_the_shipped_effect(situation):
    effect = described('"k * s"', '{ k = "1" }')
    shipped = effect_named("screw-pitch", situation.machine)
    own = effect.signature(situation, np.zeros(6)).extension
    np.testing.assert_array_equal(own, shipped.signature(situation, np.zeros(6)).extension)
    assert [u.name for u in effect.unknowns(situation.rows)][2] == "own.leg3.k"


def test_size_is_what_moves_the_readings_by_ten_micrometres(situation):
    effect = described('"k * s**2"', '{ k = "1/mm" }')
    unknown = effect.unknowns(situation.rows)[0]
    platform = situation.rows.on_platform
    moved = unknown.size * situation.rows.extension[:, platform] ** 2
    assert np.sqrt(np.mean(moved**2)) == pytest.approx(0.01)


def test_missing_channel_is_said(situation):
    effect = described('"k * spindle_C"', '{ k = "mm/K" }')
    assert "no column spindle_C" in effect.unavailable(situation.rows)


def test_formula_without_value_names_the_reading(situation):
    effect = described('"k * log(s)"', '{ k = "mm" }')
    assert "has no value at" in effect.unavailable(situation.rows)
    assert "line" in effect.unavailable(situation.rows)


def test_actuator_that_does_not_exist_is_said(situation):
    effect = described('"k * s7"', '{ k = "1" }')
    assert "there are 6 actuators" in effect.unavailable(situation.rows)


def test_example_of_the_docs_works(situation):
    page = Path(__file__).parents[2] / "docs" / "own-effects.md"
    blocks = page.read_text(encoding="utf-8").split("```toml\n")[1:]
    text = next(block for block in blocks if "[effect]" in block).split("```")[0]
    effect = effect_from_text(text, "docs")
    assert [unknown.name for unknown in effect.unknowns(situation.rows)] == [
        "warming.k",
        "warming.tau",
    ]
    check_derivatives(effect, situation, np.random.default_rng(4))
