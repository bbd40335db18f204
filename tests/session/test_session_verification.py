"""Verification: what is measured of a known error, against truth and against noise alone."""

from collections.abc import Callable
from pathlib import Path

import pytest
from session_mock import POSES, Mock

from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from app.verification import Verification, judge


async def verified(mock: Mock, folder: Path) -> Verification:
    options = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False, truth=True)
    plan = measure_plan(mock.site, POSES, options, "verify")
    session = Session.create(mock.site, plan, folder, unattended=True)
    try:
        await session.run()
        return judge(mock.site, plan, session.journal)
    finally:
        await session.close()


@pytest.mark.long
async def test_the_tracker_sees_the_true_error_to_within_its_noise(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    found = await verified(mock_of("--smrs", "3", "--seed", "5"), tmp_path)
    assert found.labels == tuple(POSES)
    assert found.truth is not None
    assert found.truth.position_peak_um > 100.0
    seen, true = found.measured, found.truth
    assert seen.position_peak_um == pytest.approx(true.position_peak_um, abs=20.0)
    assert seen.orientation_peak_deg == pytest.approx(true.orientation_peak_deg, abs=0.015)
    assert 1.0 < found.noise_peak_um < 20.0


@pytest.mark.long
async def test_a_perfect_machine_shows_what_noise_alone_predicts(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    nominal = tmp_path / "truth.json"
    machine = mock_of().site.machine
    nominal.write_text(str({p.name: p.nominal for p in machine.parameters}).replace("'", '"'))
    mock = mock_of("--smrs", "3", "--truth", str(nominal))
    found = await verified(mock, tmp_path)
    assert found.truth is not None
    assert found.truth.position_peak_um < 1.0
    assert 0.3 < found.measured.position_peak_um / found.noise_peak_um < 3.0
    assert 0.3 < found.measured.orientation_peak_deg / found.noise_peak_deg < 3.0
