"""``[load]`` and the payload: gravity in its unit, centres of mass in mm, masses in kg."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.runs.header import Load
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

STANDARD = 9.80665
"""m/s^2."""
EARTH = (9.75, 9.86)
"""Least and largest acceleration of free fall on the ground, m/s^2."""
_GRAVITY_UNITS = ((STANDARD, "g"), (0.001, "mm/s^2"), (0.01, "cm/s^2"), (0.3048, "ft/s^2"))
HEAVIEST = 2000.0
"""Mass of a platform, kg, above which it is in grams."""
POUND = 0.45359237
"""kg."""
ROUND = 6e-4
"""How near (kg) a mass must be to a round one."""
SENTINELS = (-1.0, 999.0, 9999.0, -999.0, -9999.0, 99999.0)
"""What is written instead of a mass, exactly."""
HEAVY = 100.0
"""Payload over the mass of the platform that no machine carries."""


def load_and_payload(run: Run) -> tuple[Run, list[Remark]]:
    """Look at what the machine carries; only the unit of gravity is certain and converted."""
    load = run.header.load
    if load is None:
        return run, []
    remarks = []
    load, remark = _gravity(run, load)
    if remark is not None:
        remarks.append(remark)
        run = replace(run, header=replace(run.header, load=load))
    run, lost = _lost(run)
    return run, [*remarks, *lost, *_centres(run, load), *_payload(run, load)]


def _gravity(run: Run, load: Load) -> tuple[Load, Remark | None]:
    size = float(np.linalg.norm(load.gravity))
    if EARTH[0] <= size <= EARTH[1]:
        return load, None
    if size == 0.0 and not _carries(run, load):
        return load, None
    for factor, unit in _GRAVITY_UNITS:
        if EARTH[0] <= size * factor <= EARTH[1]:
            return replace(load, gravity=factor * load.gravity), Remark(
                "gravity-unit",
                f"[load] gravity looks like {unit}: its size is {size:.5g}, not 9.81 m/s^2",
                (),
                "There is no such free fall on the ground",
                f"Read as {unit}",
                "Write gravity in m/s^2",
                True,
                run.source,
            )
    return load, Remark(
        "gravity-size",
        f"[load] gravity has the size {size:.4g} m/s^2; on the ground it is 9.81",
        (),
        "There is no such free fall on the ground",
        "Taken as it stands: what is found for the weight is off by that factor",
        "Correct gravity in run.toml",
        False,
        run.source,
    )


def _centres(run: Run, load: Load) -> list[Remark]:
    """Centres of mass that are a thousand times too near the origin: metres."""
    found = []
    for key, centre in (("platform_com", load.platform_com), ("payload_com", load.payload_com)):
        size = float(np.linalg.norm(centre))
        if 0.0 < size < 0.5 and float(np.max(np.abs(1000.0 * centre % 1.0))) < 1e-6:
            found.append(
                Remark(
                    "centre-of-mass-unit",
                    f"[load] {key} looks like m: it lies {size:.3g} mm from the platform's origin",
                    (),
                    f"In m it would be {1000 * size:.4g} mm, a round number",
                    "Taken as it stands: what is found for the weight may be off",
                    f"Write {key} in mm",
                    False,
                    run.source,
                )
            )
    return found


def _carries(run: Run, load: Load) -> bool:
    masses = run.channels.get("payload_kg", np.zeros(1))
    return load.platform_mass_kg > 0.0 or bool(np.any(masses > 0.0))


def _payload(run: Run, load: Load) -> list[Remark]:
    masses = run.channels.get("payload_kg")
    if load.platform_mass_kg > HEAVIEST:
        return [
            Remark(
                "mass-in-grams",
                f"[load] platform_mass_kg looks like grams: {load.platform_mass_kg:g} kg",
                (),
                "No platform that is measured like this weighs so much",
                "Taken as it stands: what is found for the weight is off by that factor",
                "Write platform_mass_kg in kg",
                False,
                run.source,
            )
        ]
    if masses is None or not np.isfinite(masses).any():
        return []
    heaviest = float(np.nanmax(masses))
    if np.nanmin(masses) < 0.0:
        return [_masses(run, "payload-negative", "payload_kg is negative: no mass is")]
    if _in_pounds(masses):
        return [
            _masses(
                run,
                "payload-in-lb",
                f"payload_kg looks like lb: {heaviest:g} is {POUND * heaviest:.4g} kg",
            )
        ]
    if load.platform_mass_kg == 0.0 or heaviest < HEAVY * load.platform_mass_kg:
        return []
    return [
        _masses(
            run,
            "payload-in-grams",
            f"payload_kg looks like grams: {heaviest:g} kg on a platform of "
            f"{load.platform_mass_kg:g} kg",
        )
    ]


def _in_pounds(masses: Array) -> bool:
    """Whether all masses are round in kg once they are read as lb, and none is as it stands."""
    there = np.unique(masses[np.isfinite(masses) & (masses > 0.0)])
    if there.size == 0:
        return False
    return bool(np.all(_off_round(POUND * there) < ROUND) and np.all(_off_round(there) > 0.02))


def _off_round(masses: Array) -> Array:
    return np.abs(masses - 0.5 * np.round(2.0 * masses))


def _lost(run: Run) -> tuple[Run, list[Remark]]:
    """Numbers that stand for no payload at all: 999, -1, in some rows."""
    masses = run.channels.get("payload_kg")
    if masses is None:
        return run, []
    finite = np.isfinite(masses)
    marked = finite & np.isin(masses, SENTINELS)
    rest = masses[finite & ~marked]
    if not marked.any() or rest.size == 0 or np.max(rest) > 500.0:
        return run, []
    lines = ranges(run.line[marked], run.line)
    filled = masses.copy()
    known = np.flatnonzero(finite & ~marked)
    before = known[np.maximum(np.searchsorted(known, np.flatnonzero(marked)) - 1, 0)]
    filled[marked] = masses[before]
    return replace(run, channels={**run.channels, "payload_kg": filled}), [
        Remark(
            "no-payload",
            f"payload_kg is {masses[marked][0]:g} in {lines_in_words(lines)}: no mass was written",
            lines,
            f"The other rows hold {rest.min():g} to {rest.max():g} kg",
            "Read as the mass of the row before",
            "Write the mass that was carried, or leave the field empty",
            True,
            run.source,
        )
    ]


def _masses(run: Run, name: str, says: str) -> Remark:
    return Remark(
        name,
        says,
        (),
        "The size is implausible for this machine",
        "Taken as it stands: what is found for the weight is off by that factor",
        "Write payload_kg in kg",
        False,
        run.source,
    )
