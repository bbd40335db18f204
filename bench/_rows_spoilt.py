"""Records spoilt as people, trackers and screws spoil them: rows of ``points.csv``, changed."""

from collections.abc import Callable

import numpy as np

from bench._rows_stewart import commanded

Table = list[dict[str, str]]
Spoil = Callable[[Table, np.random.Generator], Table]
AXES = ("x", "y", "z")


def as_it_is(rows: Table, rng: np.random.Generator) -> Table:
    """Nothing is spoilt."""
    return rows


def exchanged(rows: Table, rng: np.random.Generator) -> Table:
    """Labels 4 and 5 changed for one another, throughout."""
    other = {"4": "5", "5": "4"}
    return [row | {"nest": other.get(row["nest"], row["nest"])} for row in rows]


def loose(rows: Table, rng: np.random.Generator) -> Table:
    """The reference nest b3 gives way by 30 um an axis, another way each time it is read."""
    return [
        row | {axis: f"{float(row[axis]) + 0.03 * rng.standard_normal():.5f}" for axis in "xyz"}
        if row["nest"] == "b3"
        else row
        for row in rows
    ]


def scattering(rows: Table, rng: np.random.Generator) -> Table:
    """Readings of nest 4 scatter four times as much as they state."""
    more = 0.005 * np.sqrt(15.0)
    return [
        row | {axis: f"{float(row[axis]) + more * rng.standard_normal():.5f}" for axis in AXES}
        if row["nest"] == "4"
        else row
        for row in rows
    ]


def _moved(row: dict[str, str], by: float) -> dict[str, str]:
    if not row["x"]:
        return row
    ways = zip(AXES, (0.8, -0.6, 0.0), strict=True)
    return row | {axis: f"{float(row[axis]) + by * way:.5f}" for axis, way in ways}


def tide(rows: Table, rng: np.random.Generator) -> Table:
    """All readings go to and fro by 20 um with a period of 50.03 s."""
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return [
        _moved(row, 0.02 * np.sin(2.0 * np.pi * float(row["time_s"]) / 50.03 + phase))
        for row in rows
    ]


def drifting(rows: Table, rng: np.random.Generator) -> Table:
    """The tracker goes 40 um one way and comes back, most of a slow wave over the run."""
    last, phase = float(rows[-1]["time_s"]), rng.uniform(0.0, 2.0 * np.pi)
    return [
        _moved(row, 0.04 * np.sin(2.0 * np.pi * float(row["time_s"]) / (1.4 * last) + phase))
        for row in rows
    ]


def twisted(rows: Table, rng: np.random.Generator) -> Table:
    """Screws of the Stewart platform turn themselves longer, by 2 mm a turn."""
    names = [f"q{k}" for k in range(1, 7)]
    changed = []
    for row in rows:
        told = commanded(np.array([float(row[name]) for name in names]), 2.0)
        changed.append(row | {name: f"{q:.6f}" for name, q in zip(names, told, strict=True)})
    return changed


def legs_exchanged(rows: Table, rng: np.random.Generator) -> Table:
    """The columns q2 and q5 are exchanged, throughout."""
    return [row | {"q2": row["q5"], "q5": row["q2"]} for row in rows]


def mirrored(rows: Table, rng: np.random.Generator) -> Table:
    """The tracker's y has the other sign."""
    return [row | {"y": f"{-float(row['y']):.5f}"} if row["y"] else row for row in rows]


def in_metres(rows: Table, rng: np.random.Generator) -> Table:
    """One column, z, is in metres."""
    return [row | {"z": f"{float(row['z']) / 1000.0:.8f}"} if row["z"] else row for row in rows]


def in_degrees(rows: Table, rng: np.random.Generator) -> Table:
    """One actuator, q2 of the ptm, is in degrees."""
    return [row | {"q2": f"{np.degrees(float(row['q2'])):.7f}"} for row in rows]
