"""Legs that are springs of their own: together they are gravity-sag; idle axes are not asked."""

from dataclasses import replace

import numpy as np
import pytest
from effects_rows import predicted, readings_of

from calib.effects import effect_named
from calib.runs.stack import Rows


def under(rows: Rows, gravity: list[float]) -> Rows:
    """The same readings with gravity, m/s^2, in another direction."""
    (run,) = rows.runs
    assert run.header.load is not None
    load = replace(run.header.load, gravity=np.array(gravity))
    return replace(rows, runs=(replace(run, header=replace(run.header, load=load)),))


def names(rows: Rows) -> list[str]:
    return [u.name for u in effect_named("leg-compliance", rows.machine).unknowns(rows)]


@pytest.mark.parametrize("name", ["hexapod", "ptm", "stewart", "delta", "arm"])
def test_legs_that_yield_alike_are_gravity_sag(name: str) -> None:
    rows = under(readings_of(name), [0.0, 0.0, -9.8])
    each, all_alike = (effect_named(e, rows.machine) for e in ("leg-compliance", "gravity-sag"))
    c = 0.1 * all_alike.unknowns(rows)[0].size
    alike = np.full(len(each.unknowns(rows)), c)
    moved = predicted(rows, each, alike) - predicted(rows, each, 0.0 * alike)
    assert np.abs(moved).max() > 1e-4
    np.testing.assert_allclose(
        predicted(rows, each, alike), predicted(rows, all_alike, np.array([c])), atol=1e-9
    )


def test_an_upright_axis_is_asked_only_where_gravity_leans() -> None:
    rows = readings_of("arm")
    every = [f"leg-compliance.{axis.name}" for axis in rows.machine.axes]
    assert names(under(rows, [0.0, 0.0, -9.8])) == every[1:]
    assert names(under(rows, [0.1, 0.0, -9.8])) == every
    effect = effect_named("leg-compliance", rows.machine)
    assert len(effect.parts(under(rows, [0.0, 0.0, -9.8]))) == len(every) - 1


def test_rods_that_are_springs_have_no_legs_that_yield() -> None:
    effect = effect_named("leg-compliance", readings_of("hexapod").machine)
    assert "its rods are what yields" in effect.lacking(readings_of("tripod").machine)
