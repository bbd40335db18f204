"""The machine drawn as it stands: it moves in its drawing, what stands still stays."""

from pathlib import Path

import numpy as np
import pytest
import tui_stream as stream
from scipy.spatial import ConvexHull

from app.files.site import load_site
from app.show.machine_sketch import ring
from app.tui.machine_view import MachineView, sketch
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
    heads, home = sketch(site, HOME, "", frame, 66, 15)
    assert heads.split() == ["front", "(x,", "z)", "from", "above", "(x,", "y)"]
    _, away = sketch(site, AWAY, "", frame, 66, 15)
    _, seen = sketch(site, AWAY, "3", frame, 66, 15)
    assert {len(line) for line in home.splitlines()} == {66}
    base = slice(-4, None)
    still = dots(home)[base, :32] == dots(away)[base, :32]
    assert still.mean() > 0.85
    assert (dots(home) != dots(away)).sum() > 20
    beam = dots(seen) & ~dots(away)
    assert beam.sum() > 5  # the beam is there
    assert not (dots(away) & ~dots(seen)).any()  # and hides nothing


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
