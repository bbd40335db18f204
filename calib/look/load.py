"""``[load]`` and the payload: gravity in its unit, centres of mass in mm, masses in kg."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.look.digits import decimals_of
from calib.look.masses import BY_CHANCE, in_other_unit
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
SENTINELS = (-1.0, 999.0, 9999.0, -999.0, -9999.0, 99999.0)
"""What is written instead of a mass, exactly."""
UNKNOWN = Load(np.array([0.0, 0.0, -STANDARD]), 0.0, np.zeros(3), np.zeros(3))
"""What is taken for granted where [load] is not there."""
HEAVY = 100.0
"""Payload over the mass of the platform that no machine carries."""


def load_and_payload(run: Run) -> tuple[Run, list[Remark]]:
    """Look at what the machine carries; only the unit of gravity is certain and converted."""
    load = run.header.load
    if load is None:
        run, lost = _lost(run)
        return run, [*lost, *_payload(run, UNKNOWN)]
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
    """Centres of mass that are no round numbers as they stand, and in m or inches are."""
    found = []
    for key, centre in (("platform_com", load.platform_com), ("payload_com", load.payload_com)):
        size = float(np.linalg.norm(centre))
        for unit, factor, largest in (("m", 1000.0, 0.5), ("inches", 25.4, 40.0)):
            if not 0.0 < size < largest or not _round_once(centre, factor):
                continue
            found.append(
                Remark(
                    "centre-of-mass-unit",
                    f"[load] {key} looks like {unit}: it lies {size:.3g} mm from the platform's "
                    "origin",
                    (),
                    f"In {unit} it would be {factor * size:.4g} mm, of round numbers",
                    "Taken as it stands: what is found for the weight may be off",
                    f"Write {key} in mm",
                    False,
                    run.source,
                )
            )
            break
    return found


def _round_once(centre: Array, factor: float) -> bool:
    """Whether numbers are whole mm once they are multiplied, and have more digits as they stand."""
    there = centre[centre != 0.0]
    digits = decimals_of(there)
    half = 0.5 * 10.0**-digits * factor + 1e-6
    whole = np.abs(factor * there - np.round(factor * there))
    by_chance = (2.0 * half) ** there.size
    return digits > 1 and bool(np.all(whole < half)) and (factor > 100.0 or by_chance < BY_CHANCE)


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
    other = in_other_unit(masses)
    if other is not None:
        unit, factor, odd = other
        lines = () if np.all(odd | ~(masses > 0.0)) else ranges(run.line[odd], run.line)
        largest = float(np.nanmax(masses[odd]))
        name = "lb" if unit == "lb" else unit.split(" ")[0]
        where = f" in {lines_in_words(lines)}" if lines else ""
        return [
            _masses(
                run,
                f"payload-in-{name}",
                f"payload_kg looks like {unit}{where}: {largest:g} is {factor * largest:.4g} kg",
                lines,
            )
        ]
    of = load.platform_mass_kg
    if heaviest < (HEAVY * of if of > 0.0 else HEAVIEST):
        return []
    on = f" on a platform of {of:g} kg" if of > 0.0 else ""
    return [_masses(run, "payload-in-grams", f"payload_kg looks like grams: {heaviest:g} kg{on}")]


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


def _masses(run: Run, name: str, says: str, lines: tuple[tuple[int, int], ...] = ()) -> Remark:
    return Remark(
        name,
        says,
        lines,
        "The size is implausible for this machine",
        "Taken as it stands: what is found for the weight is off by that factor",
        "Write payload_kg in kg",
        False,
        run.source,
    )
