"""The machine drawn as it stands: it moves in its drawing, what stands still stays."""

from pathlib import Path

import numpy as np
import pytest
import tui_stream as stream
from scipy.spatial import ConvexHull

from app.files.site import load_site
from app.show.machine_sketch import ring
from app.tui.machine_view import MachineView, Seen, enlarged, over, sketch
from app.tui.program import Workbench

HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)
AWAY = (25.0, -20.0, 228.0, 0.1, -0.1, 0.1)


def dots(drawing: str) -> np.ndarray:
    """Which characters hold a dot."""
    return np.array([[ord(sign) > 0x2800 for sign in line] for line in drawing.splitlines()])


def test_the_platform_moves_in_the_drawing_and_the_base_stays(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(stream.SITE, encoding="utf-8")
    site = load_site(tmp_path / "site.toml")
    frame = site.tracker.frame
    heads, home, _, _ = sketch(site, Seen(HOME, "", frame, {}), 66, 15)
    assert heads.split() == ["front", "(x,", "z)", "from", "above", "(x,", "y)"]
    _, away, none, times = sketch(site, Seen(AWAY, "", frame, {}), 66, 15)
    assert not dots(none).any()
    assert times == 0.0
    _, seen, _, _ = sketch(site, Seen(AWAY, "3", frame, {}), 66, 15)
    assert {len(line) for line in home.splitlines()} == {66}
    base = slice(-4, None)
    still = dots(home)[base, :32] == dots(away)[base, :32]
    assert still.mean() > 0.85
    assert (dots(home) != dots(away)).sum() > 20
    beam = dots(seen) & ~dots(away)
    assert beam.sum() > 5  # the beam is there
    assert not (dots(away) & ~dots(seen)).any()  # and hides nothing


def test_the_last_error_of_each_nest_is_an_arrow_over_the_machine(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(stream.SITE, encoding="utf-8")
    site = load_site(tmp_path / "site.toml")

    def drawn(off: float) -> tuple[str, str, float]:
        seen = Seen(AWAY, "", None, {"3": (off, 0.0, 0.0)})
        _, drawing, arrows, times = sketch(site, seen, 66, 15)
        return drawing, arrows, times

    drawing, right, times = drawn(0.5)
    _, left, back = drawn(-0.5)
    assert times == back
    assert 5 <= dots(right).sum() <= 20  # two views of one arrow
    starts = dots(right) & dots(left)
    for one, way in ((right, 1), (left, -1)):  # each goes its own way from the nest
        columns = np.nonzero((dots(one) & ~starts)[:, :33])[1]
        assert (way * (columns - np.nonzero(starts[:, :33])[1].mean()) > 0).all()
    text = over(drawing, right)
    assert len(text.plain) == len(drawing)
    assert sum(span.end - span.start for span in text.spans) == dots(right).sum()


@pytest.mark.parametrize("size", [3e-6, 0.0007, 0.04, 12.0])
def test_errors_are_enlarged_by_a_round_number_to_a_length_that_is_seen(size: float) -> None:
    off = np.array([[size, 0.0], [0.0, 0.3 * size], [0.0, 0.0]])
    times = enlarged(off, 60.0)
    assert 24.0 <= times * size <= 60.0 * (1 + 1e-9)
    assert f"{times:.3e}"[:5] in ("1.000", "2.000", "5.000")


@pytest.mark.parametrize("seed", range(5))
def test_the_ring_of_joints_is_their_convex_hull(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(3, 9)) * [[1.0], [1.0], [0.01]]
    drawn = {tuple(point) for point in ring(points).T}
    plane = np.linalg.svd(points - points.mean(axis=1, keepdims=True))[0][:, :2]
    wanted = ConvexHull((plane.T @ points).T).vertices
    assert drawn == {tuple(points[:, k]) for k in wanted}


@pytest.mark.long
async def test_it_is_drawn_where_there_is_room(tmp_path: Path) -> None:
    for size, drawn in (((160, 48), True), ((80, 24), False)):
        bench = Workbench(root=tmp_path / str(size[0]))
        async with bench.run_test(size=size) as pilot:
            await stream.put_up(bench, tmp_path)
            await pilot.press("2")
            await pilot.pause(0.6)
            view = bench.screen.query_one(MachineView)
            assert bool(view.region) is drawn
            assert any(ord(sign) > 0x2800 for sign in str(view.render())) is drawn
