"""Stars that others measured (tests/data/real/mmt), in the manner of TPOINT's files."""

from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_run
from app.jobs.importing import import_run
from calib.errors import BadInput

DATA = Path(__file__).parents[1] / "data"
STARS = DATA / "real" / "mmt" / "k_and_e.dat"
HEADER = DATA / "maps" / "mount-run.toml"


def test_stars_are_directions_of_the_tube(tmp_path: Path) -> None:
    report = import_run(STARS, "tpoint", tmp_path / "run", header=HEADER)
    run = read_run(tmp_path / "run").run
    assert (report.readings, report.poses) == (81, 80)
    stars = np.loadtxt(STARS, skiprows=20, comments="END").T
    azimuth, elevation = np.radians(stars[:2])
    direction = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    centre = run.position[:, [run.nest.index("centre")]]
    tube = np.array(run.nest) == "tube"
    assert np.allclose(run.position[:, tube] - centre, 1000.0 * direction, atol=1e-6)
    across = np.einsum("in,ijn,jn->n", direction, run.covariance[:, :, tube], direction)
    assert np.allclose(across, 0.1**2)
    whole = np.einsum("iin->n", run.covariance[:, :, tube])
    assert np.allclose(
        np.sqrt(0.5 * (whole - across)), 1000.0 * np.radians(1.0 / 3600.0), rtol=1e-4
    )
    assert np.allclose(np.degrees(run.q[:, tube]), stars[2:])
    assert any("the same from everywhere" in one for one in report.assumed)


def test_a_file_of_another_kind_of_mount_is_refused_by_its_width(tmp_path: Path) -> None:
    text = STARS.read_text().replace(": ALTAZ", ": EQUAT").replace(" 77.3475476", " 1 2 3 4", 1)
    (tmp_path / "stars.dat").write_text(text)
    with pytest.raises(BadInput, match=r"line 21: 7 fields found\. Expected 4, as the map says"):
        import_run(tmp_path / "stars.dat", "tpoint", tmp_path / "run", header=HEADER)
