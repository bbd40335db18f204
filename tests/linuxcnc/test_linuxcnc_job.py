"""The whole job by its command, with LinuxCNC itself and screws without a guide."""

import json
import subprocess
from pathlib import Path

import pytest

from app.again import command_of
from mocks.linuxcnc.program import why_not

LEAD_MM = 2.0


@pytest.mark.long
@pytest.mark.timeout(800)
@pytest.mark.skipif(bool(why_not()), reason=why_not() or "it is there")
def test_the_job_on_linuxcnc_leaves_what_the_tracker_cannot_see(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))
    words = command_of("demo", "--linuxcnc", "--lead", str(LEAD_MM), "--poses", "20", "--json")
    done = subprocess.run(
        [*words, "--out", str(tmp_path / "out")], capture_output=True, text=True, timeout=780
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    peaks = {when: found[when]["truth"]["position_peak_um"] for when in ("before", "after")}
    assert peaks["before"] > 100.0
    assert peaks["after"] < 15.0
    hal = (tmp_path / "out" / "linuxcnc" / "hexapod.hal").read_text(encoding="utf-8")
    (lead,) = [line.split()[2] for line in hal.splitlines() if "screw-lead" in line]
    assert float(lead) == pytest.approx(-LEAD_MM, abs=0.1)
