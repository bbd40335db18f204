"""The whole job where the host computes: what was found beside the geometry is compensated too."""

from pathlib import Path

import numpy as np
import pytest
from hosted_lab import Lab, lab

from app.files.fits import SavedFit, read_fit
from app.files.machines import load_machine
from app.files.models import write_model
from app.files.runs import read_run
from app.session.known import compare_with_known
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from app.session.station import Station
from app.writeback.gates import Gates
from app.writeback.procedure import Applied, WriteBack, undo
from calib.effects import effect_named
from calib.identify.staged import fit_effects
from calib.mechanism.rigid import Poses
from calib.poses import verification_poses
from calib.runs import Run
from calib.runs.stack import stack

pytestmark = pytest.mark.long

MACHINE = load_machine("hexapod")
EFFECTS = ("backlash", "gravity-sag", "screw-cyclic")
HIDDEN = {
    **{f"backlash.leg{k}": 0.03 + 0.01 * (k % 3) for k in range(1, 7)},
    **{f"screw-cyclic.leg{k}.sin": 0.012 for k in (1, 3, 5)},
    **{f"screw-cyclic.leg{k}.cos": -0.01 for k in (2, 4)},
    "screw-cyclic.period": 4.0,
    "gravity-sag.c": 4e-4,
}
PAYLOAD_KG = 5.0
GRID = verification_poses(MACHINE).by_label


async def measured(here: Lab, folder: Path, count: int) -> Run:
    """Measure some poses of the grid."""
    site = here.site(payload_kg=PAYLOAD_KG)
    chosen = np.random.default_rng(count).permutation(list(GRID))[:count]
    options = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False)
    plan = measure_plan(site, {label: GRID[label] for label in chosen}, options)
    session = Session.create(site, plan, folder, unattended=True)
    try:
        outcome = await session.run()
    finally:
        await session.close()
    run = read_run(outcome.run_folder).run
    assert not run.header.controller_parameters
    assert not run.header.compensation
    return run


def fitted(run: Run, effects: tuple[str, ...], folder: Path) -> SavedFit:
    """Fit a run with effects of the catalogue, saved and read back."""
    chosen = [effect_named(effect, MACHINE) for effect in effects]
    path = folder / f"model-{len(effects)}.toml"
    write_model(path, fit_effects(stack(MACHINE, [run]), chosen))
    return read_fit(path)


async def yes(*_: object) -> bool:
    return True


async def applied(here: Lab, found: SavedFit, folder: Path) -> Applied:
    station = Station(here.site(payload_kg=PAYLOAD_KG))
    check = {label: GRID[label] for label in list(GRID)[5::70]}
    await station.connect()
    try:
        job = WriteBack(
            station,
            found,
            Gates.with_limits({}),
            folder,
            yes,
            unattended=True,
            poses=check,
        )
        return await job.run()
    finally:
        await station.close()


async def true_misses(here: Lab) -> np.ndarray:
    """Where the platform really is at fresh poses, against where it was sent, um."""
    station = Station(here.site(payload_kg=PAYLOAD_KG))
    machine = station.site.machine
    box = np.array([machine.workspace[name] for name in ("x", "y", "z", "rx", "ry", "rz")])
    middle, half = box.mean(axis=1), 0.3 * np.ptp(box, axis=1)
    poses = middle + half * np.random.default_rng(11).uniform(-1, 1, (12, 6))
    await station.connect()
    try:
        controller = station.controller
        await controller.enable()
        misses = []
        for pose in poses:
            controller.told({"payload_kg": PAYLOAD_KG})  # type: ignore[attr-defined]
            await controller.move_to_pose(tuple(map(float, pose)))
            await controller.wait_arrived(20.0)
            misses.append(here.misses(Poses.from_xyz_rpy(pose[:, None]))[0])
        await controller.disable()
        return np.array(misses)
    finally:
        await station.close()


@pytest.mark.usefixtures("line_kind")
async def test_named_added_and_the_error_of_the_machine_falls(tmp_path: Path) -> None:
    async with lab(tmp_path, HIDDEN) as here:
        here.world.payload_kg = PAYLOAD_KG
        before = await true_misses(here)
        run = await measured(here, tmp_path, 30)
        whole = fitted(run, EFFECTS, tmp_path)
        done = await applied(here, whole, tmp_path)
        after = await true_misses(here)
        assert not done.proposal.left_out
        again = fitted(await measured(here, tmp_path, 20), EFFECTS, tmp_path)
        undone = Station(here.site())
        await undone.connect()
        try:
            held = await compare_with_known(undone.site, undone.controller)
            assert (
                held.values["screw-cyclic.period"] == whole.estimates["screw-cyclic.period"].value
            )
            await undo(undone, done.snapshot, "undo")
            back = await compare_with_known(undone.site, undone.controller)
        finally:
            await undone.close()
    # With the geometry alone 32 um stay in the mean, 80 um at the worst pose.
    assert before.mean() > 300.0
    assert after.mean() < 10.0
    assert back.values == done.snapshot.values
    assert not any(name.startswith("backlash") for name in back.values)
    # A run of a host has the whole of each effect again, whatever was compensated meanwhile.
    for name in ("gravity-sag.c", "backlash.leg1", "screw-cyclic.leg3.sin"):
        one, two = whole.estimates[name], again.estimates[name]
        assert abs(one.value - two.value) < 5.0 * np.hypot(one.sigma, two.sigma)
