"""An error model of poses alone: near the geometry with terms of the operator, far without."""

from bench.six_stage import own_terms, rows_of


def test_there_are_terms_for_every_stage() -> None:
    assert sorted(effect.id for effect in own_terms()) == [f"cross-{axis}" for axis in "uvwxyz"]


def test_poses_that_were_not_fitted_choose_the_model() -> None:
    """A hexapod out of its tolerances, 40 poses: what is known of it orders what is left."""
    held = {name: rms for name, rms, *_ in rows_of(1, 40)}
    known, stages = held["geometry of the legs"], held["six stages"]
    assert known < 0.5 * held["and products of commands"]
    assert held["and products of commands"] < 0.7 * stages
    assert stages < 0.3 * held["nothing"]
