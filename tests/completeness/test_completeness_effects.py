"""Every effect on every machine has all that it needs; one that lacks something is told what."""

import pytest
from effect_checks import (
    PAGE,
    complaints,
    repeated_names,
    stale_rows,
    unsimulated,
)
from made_run import MACHINES, machine_of

from calib.effects import Effect, Signature, catalogue
from calib.effects.component import per_actuator
from calib.unknown import Unknown
from mocks.hidden import effects, effects_of
from mocks.hidden.effect import HiddenEffect, Physics
from mocks.physics.bodies import BODIES

EVERY = [(name, effect) for name in MACHINES for effect in catalogue(machine_of(name))]
# The three machines that mocks are made of; all others in the long stage.
FIRST = tuple(BODIES)
HIDDEN = effects()


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        pytest.param(m, e, id=f"{m}-{e.id}", marks=() if m in FIRST else pytest.mark.long)
        for m, e in EVERY
    ],
)
def test_completeness_effect_has_all_that_it_needs(name, effect):
    assert list(complaints(effect, name, PAGE.read_text(encoding="utf-8"), HIDDEN)) == []


@pytest.mark.parametrize("name", MACHINES)
def test_completeness_names_of_effects_and_unknowns_are_unique(name):
    assert list(repeated_names(catalogue(machine_of(name)), name)) == []


def test_completeness_page_has_no_row_of_an_effect_that_is_gone():
    assert list(stale_rows(PAGE.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("name", BODIES)
def test_completeness_mocks_hide_nothing_under_a_name_of_the_catalogue_that_the_machine_lacks(name):
    known = {effect.id for effect in catalogue(machine_of(name))}
    own = {effect.id for effect in effects_of(name) if not effect.id.startswith("unknown.")}
    assert own == known


def test_completeness_hidden_effects_have_a_row_in_the_page_of_the_mocks():
    page = (PAGE.parent / "mocks.md").read_text(encoding="utf-8")
    for effect in HIDDEN:
        where = "all" if len(effect.machines) == len(BODIES) else ", ".join(effect.machines)
        assert f"| `{effect.id}` | {effect.says} | {where} |" in page


class Creaking(Effect):
    """An effect as somebody might add it: each leg errs by the cube of its extension."""

    id = "creaking"
    kind = "machine"
    says = "a leg creaks"
    factor = 1.0

    def unknowns(self, rows):
        return tuple(Unknown(f"creaking.{axis.name}", "1/mm^2", 1e-6) for axis in rows.machine.axes)

    def signature(self, situation, values):
        return Signature(extension=per_actuator(self.factor * situation.rows.extension**3))


class HiddenCreaking(HiddenEffect):
    """The same as a mock does it."""

    id = "creaking"
    numbers = "leg[1-6]"
    says = "1/mm^2: extension = k s^3"
    machines = ("hexapod",)
    factor = 1.0

    def example(self, site):
        return {"backlash.leg1": 0.01}

    def physics(self, hidden, limbs, stroke):
        return Physics(extension=lambda c: c.extension)


ROWS = """| `creaking` | machine | one a leg |

| unknown | unit | size | prior |
|---|---|---|---|
| `creaking.*` | 1/mm^2 | 1e-6 | |

"""


def said(effect=None, page=ROWS, hidden=()):
    return "; ".join(complaints(effect or Creaking(), "hexapod", page, hidden))


def test_completeness_effect_without_a_row_is_told():
    assert "docs/effects.md has no row for creaking" in said(page="")
    assert "creaking measurement" in said(page=ROWS.replace("machine", "measurement"))
    assert "no row with unit, size and prior of creaking.leg1" in said(
        page=ROWS.replace("-6", "-5")
    )
    assert "no row with unit, size and prior" in said(page=ROWS.replace("1e-6 | |", "1e-6 | 1 |"))
    assert "docs/effects.md" not in said()
    assert list(stale_rows(ROWS)) == [
        "docs/effects.md has a row for creaking, which is not shipped" for _ in "ab"
    ]


def test_completeness_effect_that_no_mock_hides_is_told():
    assert "mocks/hidden has no creaking" in said()
    elsewhere = HiddenCreaking()
    elsewhere.machines = ("tripod",)
    assert "the mock hexapod cannot have creaking" in said(hidden=[elsewhere])


def test_completeness_effect_without_a_draw_or_with_another_example_is_told():
    found = "; ".join(unsimulated(Creaking(), "hexapod", [HiddenCreaking()]))
    assert "creaking has no draw for the hexapod" in found
    assert "example of creaking names none of its unknowns" in found
    hidden = HiddenCreaking()
    hidden.unseen = ("hexapod",)
    assert "the blind trial never draws creaking" in said(hidden=[hidden])


def test_completeness_effect_whose_column_is_wrong_is_told():
    class Wrong(Creaking):
        def signature(self, situation, values):
            cube = per_actuator(situation.rows.extension**3)
            cube[0] *= 1.0 + 1e6 * values[0]  # no longer linear in its unknown
            return Signature(extension=cube)

    assert "column of creaking.leg1 is off" in said(Wrong())
    assert "column" not in said()


def test_completeness_effect_that_needs_what_no_run_has_or_shares_a_name_is_told():
    class Demanding(Creaking):
        channels = ("moon",)

        def unknowns(self, rows):
            return (Unknown("backlash.leg1", "mm", float("nan")),)

    found = said(Demanding())
    assert "unavailable in a run that has everything" in found
    assert "does not begin with creaking." in found
    assert "has no usual size" in found
    both = [*catalogue(machine_of("hexapod")), Demanding()]
    assert list(repeated_names(both, "hexapod")) == [
        "hexapod: the name backlash.leg1 is used twice"
    ]


def test_completeness_effect_that_the_mock_does_otherwise_is_told():
    backlash = next(e for e in catalogue(machine_of("hexapod")) if e.id == "backlash")

    class Mirrored(type(backlash)):
        def signature(self, situation, values):
            return Signature(extension=-super().signature(situation, values).extension)

    page = PAGE.read_text(encoding="utf-8")
    found = "; ".join(complaints(Mirrored(), "hexapod", page, HIDDEN))
    assert "backlash moves the mock by" in found
