"""``[load]`` and the payload: gravity in its unit, centres of mass in mm, masses in kg."""

from dataclasses import replace

import numpy as np

from calib.runs.header import Load
from calib.runs.record import Run
from calib.runs.remark import Remark

STANDARD = 9.80665
"""m/s^2."""
EARTH = (9.75, 9.86)
"""Least and largest acceleration of free fall on the ground, m/s^2."""
_GRAVITY_UNITS = ((STANDARD, "g"), (0.001, "mm/s^2"), (0.01, "cm/s^2"), (0.3048, "ft/s^2"))
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
    return run, [*remarks, *_centres(run, load), *_payload(run, load)]


def _gravity(run: Run, load: Load) -> tuple[Load, Remark | None]:
    size = float(np.linalg.norm(load.gravity))
    if size == 0.0 or EARTH[0] <= size <= EARTH[1]:
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


def _payload(run: Run, load: Load) -> list[Remark]:
    masses = run.channels.get("payload_kg")
    if masses is None or not np.isfinite(masses).any():
        return []
    heaviest = float(np.nanmax(masses))
    if np.nanmin(masses) < 0.0:
        return [_masses(run, "payload-negative", "payload_kg is negative: no mass is")]
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
