"""Write-back through the wires: kept when all is well, put back when anything is not."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from session_mock import POSES, Heard, Mock

from app.errors import GateRefused, StoppedByOperator
from app.files.fits import SavedFit, read_fit
from app.files.models import write_model
from app.files.runs import read_run
from app.session import events as ev
from app.session.known import compare_with_known, read_held
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from app.session.station import Devices, Station
from app.writeback.gates import Gates
from app.writeback.procedure import WriteBack, accept, undo
from app.writeback.transfer import snapshots_of
from calib.identify import fit
from calib.model import Model
from calib.poses import verification_poses
from calib.runs.stack import stack
from calib.unknown import Estimate, Unknown
from drivers.errors import DeviceError, ParameterError
from drivers.interface import MotionController

# Three check poses are enough here.
CHECK = {label: POSES[label] for label in "bdf"}


async def measured_fit(mock: Mock, folder: Path) -> SavedFit:
    """Measure 18 poses of the grid and fit them."""
    grid = verification_poses(mock.site.machine).by_label
    poses = {label: grid[label] for label in list(grid)[::12]}
    options = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False)
    session = Session.create(
        mock.site, measure_plan(mock.site, poses, options), folder, unattended=True
    )
    try:
        outcome = await session.run()
    finally:
        await session.close()
    loaded = read_run(outcome.run_folder)
    path = folder / "model.toml"
    write_model(path, fit(Model(stack(loaded.machine, [loaded.run]), [])))
    return read_fit(path)


async def yes(*_: object) -> bool:
    return True


def job(station: Station, found: SavedFit, folder: Path) -> WriteBack:
    return WriteBack(
        station, found, Gates.with_limits({}), folder, yes, unattended=True, poses=CHECK
    )


async def test_apply_corrects_the_machine_and_undo_brings_the_old_set_back(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", "--seed", "7", scale=600)
    found = await measured_fit(mock, tmp_path)
    station = Station(mock.site)
    station.observers.watch(heard)
    await station.connect()
    try:
        old = await read_held(station.site, station.controller)
        applied = await job(station, found, tmp_path).run()
        assert applied.after.position_peak_um < 0.2 * applied.before.position_peak_um
        await station.controller.reload_parameters()  # what survives a power cycle
        now = await compare_with_known(station.site, station.controller)
        assert now.values["leg1.B_x"] == found.estimates["leg1.B_x"].value
        with pytest.raises(GateRefused, match="holds this fit already") as refused:
            await job(station, found, tmp_path).propose()
        assert refused.value.nothing_to_gain
        assert found.controller_serial == station.controller.identity.serial
        await undo(station, applied.snapshot, "undo")
        back = await compare_with_known(station.site, station.controller)
        assert back == old
        assert [s.why for s in snapshots_of(station).all()][-1] == "before undo"
    finally:
        await station.close()
    assert not [gate for gate in heard.of(ev.GateChecked) if not gate.passed]


def small_change(station: Station, by: float = 0.02) -> SavedFit:
    """A fit that passes every gate before writing: nominal, but for one leg's length."""
    estimates = {
        p.name: Estimate(
            Unknown(p.name, "mm"), p.nominal + (by if p.name == "leg1.L0" else 0.0), 1e-3
        )
        for p in station.site.machine.parameters
    }
    quality = {"chi2_per_dof": 1.0, "holdout_rms_um": 9.0, "holdout_floor_um": 9.0}
    covariance = 1e-6 * np.eye(len(estimates))
    return SavedFit("made.toml", "hexapod", (), estimates, quality, covariance, False)


@pytest.mark.long
async def test_a_value_that_reads_back_differently_restores_the_snapshot(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    station = Station(mock.site)
    station.observers.watch(heard)

    def corrupt(event: ev.Event) -> None:
        if isinstance(event, ev.WriteBackStage) and event.stage == "write":
            mock.hands("fault", name="parameter-corrupt:leg1.L0")
        if isinstance(event, ev.WriteBackStage) and event.stage == "restore":
            mock.hands("clear")

    station.observers.watch(corrupt)
    await station.connect()
    try:
        with pytest.raises(ParameterError, match=r"leg1\.L0"):
            await job(station, small_change(station), tmp_path).run()
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg1.L0"] == 230.715
    assert heard.of(ev.WriteBackStage)[-1].stage == "restored"


@pytest.mark.long
async def test_a_refused_store_restores_the_snapshot(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    station = Station(mock.site)
    station.observers.watch(heard)
    mock.hands("fault", name="store-refused")
    await station.connect()
    found = small_change(station, by=-1e-3)
    gates = Gates.with_limits({"gain": 100.0, "check-peak": 1e6, "check-rms": 1.5})
    try:
        with pytest.raises(DeviceError, match="stor"):
            await WriteBack(station, found, gates, tmp_path, yes, True, CHECK).run()
        assert heard.of(ev.WriteBackStage)[-1].stage == "restored"
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg1.L0"] == 230.715


@pytest.mark.long
async def test_a_restore_that_fails_latches_and_blocks_motion_until_undone(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    station = Station(mock.site)
    station.observers.watch(heard)

    def corrupt(event: ev.Event) -> None:
        if isinstance(event, ev.WriteBackStage) and event.stage == "write":
            mock.hands("fault", name="parameter-corrupt:leg1.L0")

    leave = station.observers.watch(corrupt)
    await station.connect()
    try:
        with pytest.raises(ParameterError, match="parameters are unknown"):
            await job(station, small_change(station), tmp_path).run()
        leave()
        mock.hands("clear")
        with pytest.raises(ParameterError, match="undo"):
            await compare_with_known(station.site, station.controller)
        first = snapshots_of(station).get(1)
        await undo(station, first, "undo to 1")
        assert (await compare_with_known(station.site, station.controller)).values == first.values
    finally:
        await station.close()


@pytest.mark.long
async def test_check_poses_that_are_worse_put_everything_back(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    station = Station(mock.site)
    await station.connect()
    try:
        with pytest.raises(GateRefused, match="check-peak"):
            await job(station, small_change(station, by=0.5), tmp_path).run()
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg1.L0"] == 230.715


@pytest.mark.long
async def test_a_no_from_the_operator_puts_everything_back(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    station = Station(mock.site)

    async def no(*_: object) -> bool:
        return False

    gates = Gates.with_limits({"check-peak": 1e6, "check-rms": 10.0})
    await station.connect()
    try:
        found = small_change(station)
        with pytest.raises(GateRefused, match="not confirm"):
            await WriteBack(station, found, gates, tmp_path, no, True, CHECK).run()
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg1.L0"] == 230.715


async def test_what_the_controller_holds_can_be_accepted_knowingly(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    station = Station(mock.site)
    await station.connect()
    try:
        await station.controller.disable()
        await station.controller.write_parameters({"leg2.B_x": -46.5})
        with pytest.raises(ParameterError, match=r"leg2\.B_x"):
            await compare_with_known(station.site, station.controller)
        await accept(station)
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg2.B_x"] == -46.5


class WithASecondWriter:
    """The connected controller, to which somebody else writes right after its values were read."""

    def __init__(self, controller: MotionController, name: str) -> None:
        self._controller, self._name = controller, name

    async def parameter_checksum(self) -> int:
        return await self._controller.parameter_checksum()

    async def read_parameters(self) -> dict[str, float]:
        values = await self._controller.read_parameters()
        await self._controller.write_parameters({self._name: values[self._name] + 0.25})
        return values


@pytest.mark.parametrize("name", ["leg2.B_x", "backlash.leg1"])
async def test_parameters_that_change_while_they_are_read_are_no_set(
    mock_of: Callable[..., Mock], tmp_path: Path, name: str
) -> None:
    """Each value was right when it was read, the set is not: the checksum tells."""
    station = Station(mock_of("--smrs", "3", scale=600).site)
    await station.connect()
    try:
        await station.controller.disable()
        meddled = cast(MotionController, WithASecondWriter(station.controller, name))
        with pytest.raises(ParameterError, match="changed while they were read"):
            await read_held(station.site, meddled)
        held = await read_held(station.site, station.controller)
        assert held.checksum == await station.controller.parameter_checksum()
    finally:
        await station.close()


class CountsStores:
    """A controller that counts what is stored; once it is not there when it is to load again."""

    def __init__(self, controller: MotionController, breaks: bool) -> None:
        self._controller, self._breaks = controller, breaks
        self.stores = 0

    def __getattr__(self, name: str) -> object:
        return getattr(self._controller, name)

    async def store_parameters(self) -> None:
        self.stores += 1
        await self._controller.store_parameters()

    async def reload_parameters(self) -> None:
        if self._breaks and self.stores:
            self._breaks = False
            raise DeviceError("no answer", device="controller")
        await self._controller.reload_parameters()


@pytest.mark.long
@pytest.mark.parametrize(("breaks", "stores"), [(False, 0), (True, 2)])
async def test_what_may_have_been_stored_is_put_back_for_good_and_nothing_else_is_stored(
    mock_of: Callable[..., Mock], tmp_path: Path, breaks: bool, stores: int
) -> None:
    """Stored, and then it breaks: the earlier set is stored again. Not confirmed: nothing is."""
    station = Station(mock_of("--smrs", "3", scale=600).site)

    async def answer(*_: object) -> bool:
        return breaks

    await station.connect()
    try:
        counts = CountsStores(station.controller, breaks)
        tracker = station.tracker
        station._devices = Devices(cast(MotionController, counts), tracker)
        gates = Gates.with_limits({"gain": 100.0, "check-peak": 1e6, "check-rms": 10.0})
        found = small_change(station, by=-1e-3)
        with pytest.raises((DeviceError, GateRefused)):
            await WriteBack(station, found, gates, tmp_path, answer, True, CHECK).run()
        assert counts.stores == stores
        await station.controller.reload_parameters()  # what survives a power cycle
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg1.L0"] == 230.715


@pytest.mark.long
async def test_a_stop_during_the_check_poses_puts_everything_back(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=100)
    station = Station(mock.site)
    station.observers.watch(heard)
    await station.connect()
    working = job(station, small_change(station), tmp_path)
    stops: list[asyncio.Task[None]] = []

    def stop(event: ev.Event) -> None:
        written = any(stage.stage == "read-back" for stage in heard.of(ev.WriteBackStage))
        if written and isinstance(event, ev.PoseCommanded) and not stops:
            stops.append(asyncio.create_task(working.stop()))

    station.observers.watch(stop)
    try:
        with pytest.raises(StoppedByOperator):
            await working.run()
        held = await compare_with_known(station.site, station.controller)
    finally:
        await station.close()
    assert held.values["leg1.L0"] == 230.715
    assert heard.of(ev.WriteBackStage)[-1].stage == "restored"
