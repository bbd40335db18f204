"""Rigid fits: laws over random frames."""

import numpy as np
import pytest

from calib.frames import Frame, exchanged, fit_frame, nest_in_base, odd_one

POINTS = np.array([[260.0, 0, -30], [0, 260.0, -30], [-260.0, 0, -30], [0, -250.0, -10]]).T


def random_frame(seed: int) -> Frame:
    generator = np.random.default_rng(seed)
    print(f"seed {seed}")
    return Frame.of([*generator.normal(0, 1000, 3), *generator.uniform(-1.4, 1.4, 3)])


@pytest.mark.parametrize("seed", range(8))
def test_a_fit_finds_the_frame_and_the_inverse_undoes_it(seed: int) -> None:
    frame = random_frame(seed)
    found, rms = fit_frame(POINTS, frame.apply(POINTS))
    assert rms < 1e-9
    assert found.numbers() == pytest.approx(frame.numbers(), abs=1e-9)
    assert frame.inverse().apply(frame.apply(POINTS)) == pytest.approx(POINTS, abs=1e-9)
    both = frame.after(random_frame(seed + 100))
    assert both.apply(POINTS) == pytest.approx(
        frame.apply(random_frame(seed + 100).apply(POINTS)), abs=1e-9
    )


def test_a_mirrored_set_is_never_fitted_by_a_reflection() -> None:
    found, rms = fit_frame(POINTS, POINTS * np.array([[1.0], [-1.0], [1.0]]))
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)
    assert rms > 1.0


def test_exchanged_labels_are_named() -> None:
    # A square of nests would fit turned by 90 degrees: these four have no such symmetry.
    names = ("b1", "b2", "b3", "b4")
    drawn = {name: POINTS[:, k] for k, name in enumerate(names)}
    seen = {name: random_frame(3).apply(point) for name, point in drawn.items()}
    seen["b1"], seen["b2"] = seen["b2"], seen["b1"]
    _, rms = fit_frame(POINTS, np.stack([seen[name] for name in names], axis=1))
    assert exchanged(drawn, seen, rms) == {"b1": "b2", "b2": "b1"}


def test_a_nest_of_a_turned_platform() -> None:
    place = nest_in_base((1.0, 2.0, 220.0, 0.0, 0.0, np.pi / 2), (0.0, 100.0, 0.0))
    assert place == pytest.approx([-99.0, 2.0, 220.0])


def test_one_nest_that_is_off_is_named_and_nobody_is_accused_of_an_exchange() -> None:
    names = ("b1", "b2", "b3", "b4")
    # A square: turned by 90 degrees other labels fit as well, and with one nest off even better.
    square = np.array([[260.0, 0, -30], [0, 260.0, -30], [-260.0, 0, -30], [0, -260.0, -30]])
    drawn = dict(zip(names, square, strict=True))
    for off in names:
        seen = {name: random_frame(4).apply(point) for name, point in drawn.items()}
        seen[off] = seen[off] + np.array([0.0, 0.2, 0.25])
        _, rms = fit_frame(square.T, np.stack([seen[name] for name in names], axis=1))
        assert rms > 0.05
        assert exchanged(drawn, seen, rms, limit_mm=0.05) == {}
        assert odd_one(drawn, seen, limit_mm=0.05) == off
