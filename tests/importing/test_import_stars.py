"""Stars that others measured (tests/data/real/mmt), in the manner of TPOINT's files."""

from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_run
from app.jobs.fitting import fit
from app.jobs.importing import import_run
from calib.errors import BadInput

DATA = Path(__file__).parents[1] / "data"
STARS = DATA / "real" / "mmt" / "k_and_e.dat"
HEADER = DATA / "maps" / "mount-run.toml"


def test_stars_are_directions_of_the_tube(tmp_path: Path) -> None:
    """What is left of the geometric model is what its publisher found: 3.8 arcsec on the sky."""
    report = import_run(STARS, "tpoint", tmp_path / "run", header=HEADER)
    run = read_run(tmp_path / "run").run
    assert (report.readings, report.poses, report.record) == (80, 80, ())
    stars = np.loadtxt(STARS, skiprows=20, comments="END").T
    assert np.allclose(np.degrees(run.position[:2]), stars[:2])
    assert np.allclose(np.degrees(run.q), stars[2:])
    arcsec = np.radians(1.0 / 3600.0)
    assert np.allclose(run.covariance[1, 1], arcsec**2, rtol=1e-4)
    across = np.cos(run.position[1])
    assert np.allclose(across**2 * run.covariance[0, 0], arcsec**2, rtol=1e-4)
    (angles,) = fit(str(tmp_path / "run")).by_kind
    assert angles.kind == "angles"
    unknowns, numbers = 6, 160
    sky = angles.ratio * np.sqrt(2.0 * (1.0 - unknowns / numbers))  # sigmas are 1 arcsec
    assert sky == pytest.approx(3.83, abs=0.02)


def test_a_file_of_another_kind_of_mount_is_refused_by_its_width(tmp_path: Path) -> None:
    text = STARS.read_text().replace(": ALTAZ", ": EQUAT").replace(" 77.3475476", " 1 2 3 4", 1)
    (tmp_path / "stars.dat").write_text(text)
    with pytest.raises(BadInput, match=r"line 21: 7 fields found\. Expected 4, as the map says"):
        import_run(tmp_path / "stars.dat", "tpoint", tmp_path / "run", header=HEADER)
