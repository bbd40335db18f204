"""The laws of drivers, over every driver that ships."""

from pathlib import Path

import pytest
from contract_bench import (
    CONTROLLERS,
    MOTORS,
    POSE_MOVERS,
    TRACKERS,
    controller_bench,
    linuxcnc_bench,
)

from app.devices import kind_names
from drivers.contract import CONTROLLER_LAWS, MOTORS_LAWS, POSE_LAWS, TRACKER_LAWS, Law, why_not
from mocks.linuxcnc.program import why_not as why_not_linuxcnc

MOTION = ("moves", "move", "together")


@pytest.mark.parametrize("law", TRACKER_LAWS, ids=str)
@pytest.mark.parametrize("kind", TRACKERS)
async def test_tracker(kind: str, law: Law) -> None:
    async with TRACKERS[kind]() as bench:
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


@pytest.mark.long
@pytest.mark.parametrize("law", CONTROLLER_LAWS, ids=str)
@pytest.mark.parametrize("kind", CONTROLLERS)
async def test_controller(kind: str, law: Law, tmp_path: Path) -> None:
    async with controller_bench(CONTROLLERS[kind], tmp_path) as bench:
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("law", CONTROLLER_LAWS, ids=str)
async def test_linuxcnc(law: Law, tmp_path: Path) -> None:
    if reason := why_not_linuxcnc():
        pytest.skip(reason)
    async with linuxcnc_bench(tmp_path) as bench:
        await law.run(bench)


@pytest.mark.long
@pytest.mark.parametrize("law", MOTORS_LAWS, ids=str)
@pytest.mark.parametrize("kind", MOTORS)
async def test_motors(kind: str, law: Law) -> None:
    if kind == "operator" and "together" in law.says:
        pytest.skip("how a person brings a machine there is the person's business")
    if kind == "drives, cyclic" and not law.needs and not any(one in law.says for one in MOTION):
        pytest.skip("it is the same in every mode")
    async with MOTORS[kind]() as bench:
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


@pytest.mark.long
@pytest.mark.parametrize("law", POSE_LAWS, ids=str)
@pytest.mark.parametrize("kind", POSE_MOVERS)
async def test_pose_mover(kind: str, law: Law) -> None:
    async with POSE_MOVERS[kind]() as bench:
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


def test_every_kind_that_ships_has_a_bench() -> None:
    assert set(TRACKERS) == set(kind_names("tracker"))
    motors = {name.partition(",")[0] for name in MOTORS}
    assert {*CONTROLLERS, "linuxcnc", *motors, *POSE_MOVERS} == set(kind_names("controller"))
