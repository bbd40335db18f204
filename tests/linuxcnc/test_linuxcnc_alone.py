"""LinuxCNC itself, where it is installed: stations of one test each."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
from linuxcnc_bench import FOLLOWED_S, NOMINAL, Bench, keep_moving, ready, running, some_poses

from drivers.errors import ConnectFailed, LinkError, Refused
from mocks.linuxcnc.program import why_not

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(600),
    pytest.mark.skipif(bool(why_not()), reason=why_not() or "it is there"),
]


async def test_geometry_length_and_lead_belong_together(tmp_path: Path, capsys) -> None:
    """Truth of ten poses, um peak, with what is written of the true parameters."""
    lead = 2.0
    with running(tmp_path, lead) as bench:
        true = dict(bench.world.parameters)
        pins_alone = {name: v for name, v in true.items() if not name.endswith("L0")}
        found = {}
        for what, values in {
            "as drawn": NOMINAL,
            "joint centres alone": {**NOMINAL, **pins_alone},
            "and L0": true,
            "and the lead": {**true, "screw-twist.L": lead},
            "the lead with the wrong sign": {**true, "screw-twist.L": -lead},
        }.items():
            found[what] = await _peak_um(bench, {"screw-twist.L": 0.0, **values})
        with capsys.disabled():
            print(*(f"\n{what:30s} {um:8.2f} um" for what, um in found.items()))
    # The mock counts a screw's turn from its own home, the effect from the drawn one.
    assert found["and the lead"] < 3.0
    assert found["and L0"] < 0.5 * found["as drawn"]
    assert found["the lead with the wrong sign"] > 1.5 * found["and L0"]


async def _peak_um(bench: Bench, values: dict[str, float]) -> float:
    async with bench.driver() as controller:
        await controller.write_parameters(values)
        await ready(controller)
        worst = 0.0
        for pose in some_poses(10, seed=6):
            await controller.move_to_pose(pose)
            await controller.wait_arrived(20.0)
            await asyncio.sleep(FOLLOWED_S)
            worst = max(worst, bench.off_um(pose))
        return worst


async def test_killed_in_motion_it_is_lost_and_comes_back_with_what_was_stored(
    tmp_path: Path,
) -> None:
    with running(tmp_path) as bench:
        async with bench.driver(speed_mm_s=8.0) as controller:
            value = NOMINAL["leg3.P_y"] + 0.1
            await controller.write_parameters({"leg3.P_y": value})
            await controller.store_parameters()
            await ready(controller)
            await controller.move_to_pose((2.0, -3.0, -14.0, 0.02, 0.0, 0.03))
            assert (await controller.state()).moving
            bench.station.cut()
            with pytest.raises(LinkError, match="does not run"):
                await controller.wait_arrived(20.0)
            with pytest.raises(LinkError, match="does not run"):
                await keep_moving(controller)
        with pytest.raises(ConnectFailed, match="LinuxCNC"):
            async with bench.driver():
                pass
        bench.station.program.restart()
        async with bench.driver() as controller:
            assert (await controller.read_parameters())["leg3.P_y"] == value
            assert not any(a.homed for a in (await controller.state()).actuators)


async def test_without_genhexkins_it_is_refused(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    hal = tmp_path / "hexapod.hal"
    geometry = [line for line in hal.read_text(encoding="utf-8").splitlines() if "hexkins." in line]
    (tmp_path / "geometry.hal").write_text("\n".join(geometry), encoding="utf-8")
    others = [
        line for line in hal.read_text(encoding="utf-8").splitlines() if "hexkins." not in line
    ]
    text = "\n".join(others).replace("loadrt genhexkins", "loadrt trivkins coordinates=XYZABC")
    hal.write_text(text + "\n", encoding="utf-8")
    bench.station.start()
    try:
        with pytest.raises(Refused, match="pin of genhexkins is missing"):
            async with bench.driver(hal=str(tmp_path / "geometry.hal")):
                pass
    finally:
        bench.station.stop()


async def test_a_table_of_a_screw_is_followed_but_only_from_its_start(tmp_path: Path) -> None:
    """What COMP_FILE does, for which there is no pin: a trial in volatile memory is impossible."""
    bench = Bench(tmp_path)
    nominal = np.linspace(200.0, 280.0, 250)
    trim = 0.012 * np.sin(2.0 * np.pi * nominal / 4.0)
    table = "".join(f"{x:.6f} {t:.6f} {t:.6f}\n" for x, t in zip(nominal, trim, strict=True))
    (tmp_path / "screw.comp").write_text(table)
    ini = bench.station.program.ini
    entries = "[JOINT_0]\nCOMP_FILE = screw.comp\nCOMP_FILE_TYPE = 1\n"
    ini.write_text(ini.read_text().replace("[JOINT_0]\n", entries))
    pins = ["joint.0.motor-pos-cmd", "joint.0.pos-cmd", "joint.0.motor-offset"]
    bench.station.start()
    try:
        async with bench.driver() as controller:
            await ready(controller)
            for pose in some_poses(6, seed=4):
                await controller.move_to_pose(pose)
                await controller.wait_arrived(20.0)
                values = (await controller._ask("get", pins=pins))["values"]
                motor, joint, offset = (values[pin] for pin in pins)
                told = np.interp(joint, nominal, trim)
                assert motor - joint - offset == pytest.approx(told, abs=1e-4)
    finally:
        bench.station.stop()
