"""Calibrate a machine while nobody is there: measure, fit, write back, verify, and take it back.

On a mock hexapod. For your own machine leave the mock out and name your site file; SMRs that
somebody, or a robot, must carry are what ``operator`` is for (docs/scripting.md).

    python examples/night_shift.py
"""

import pkmcal


def corner_poses(count: int) -> dict[str, tuple[float, float, float, float, float, float]]:
    """Some poses of the verification grid: label -> x, y, z (mm), rx, ry, rz (rad)."""
    grid = pkmcal.verification_grid("hexapod").by_label()
    labels = list(grid)
    return {label: grid[label] for label in labels[:: len(labels) // count][:count]}


def main() -> None:
    """The whole night."""
    chosen = pkmcal.choose_poses("hexapod", 20, candidates=100)
    check = corner_poses(6)
    with (
        pkmcal.mock_station("hexapod", seed=2, scale=2000.0, folder="mock") as site,
        pkmcal.Station(site) as station,
    ):
        before = station.verify(check)
        print(f"before: peak error {before.measured.position_peak_um:.0f} um")

        measured = station.measure(chosen.by_label(), warm_up=False, title="night shift")
        found = pkmcal.fit(measured.run)
        found.save("model.toml")
        print(f"measured {measured.readings} readings, fitted to {found.rms_um:.1f} um RMS")

        try:
            done = station.apply("model.toml", yes=True)
        except pkmcal.GateRefused as refused:
            print(f"not written: {refused}")
            return
        changed = sum(change.old != change.new for change in done.changes)
        print(f"{changed} parameters written; the way back is set {done.snapshot}")

        after = station.verify(check, before=before)
        print(f"after: peak error {after.measured.position_peak_um:.0f} um")

        back = station.undo(done.snapshot)
        print(f"taken back: set {back.restored} is in the controller")


if __name__ == "__main__":
    main()
