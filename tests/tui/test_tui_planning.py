"""From a wish to a plan: what is chosen on the screen keeps the same room as the verb's choice."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
import tui_stream as stream

from app.files.site import load_site
from app.tui.planning import RunWish, plan_for
from calib.mechanism.limits import violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse
from calib.poses.margin import stroke_margin


@pytest.mark.long
def test_poses_chosen_on_the_screen_can_be_reached_by_a_calibrated_machine(tmp_path: Path) -> None:
    file = tmp_path / "site.toml"
    file.write_text(stream.SITE, encoding="utf-8")
    site = load_site(file)
    plan = asyncio.run(plan_for(site, RunWish("2", "nest-by-nest", warm_up=False)))
    poses = np.array([pose for name, pose in plan.poses.items() if name != "home"], float).T
    found = inverse(site.machine, Poses.from_xyz_rpy(poses))
    margin = stroke_margin(site.machine, site.limits.margin_mm)
    assert poses.shape[1] >= 2
    assert not violations(site.machine, found, {}, margin)
