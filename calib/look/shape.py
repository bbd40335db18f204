"""Distances between nests, read against stated: lengths that were scaled, tables of another part.

Nests on one body keep their distances whatever the machine does, so that no geometry explains
distances that are read otherwise than the table states them.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from calib.arrays import Array
from calib.effects.tracker import rigid_motions
from calib.frames import align
from calib.look.bent import Mended
from calib.look.scan import excess, fit_of, scan, with_the_excluded
from calib.mechanism.description import Machine
from calib.mechanism.rigid import exponential, rotate
from calib.runs.record import Run
from calib.runs.remark import Remark

LEAST = 3
"""Readings of a pair of nests at one stop each that tell its distance."""
SCALED = 2e-4
"""Part of all distances by which a scale is not a matter of air and refraction."""
ALIKE = 0.1
"""How far from one another ratios may be that are one scale, as part of it."""
OFF_MM = 0.15
"""Distance, mm, by which a pair must be off: less is the effect nest-offset."""
CLEAR = 8.0
"""Standard errors by which it must be."""
FALL = 0.9
"""Part of what a misfit is too much that the other table must explain."""
MOST_BAD, LOUDEST = 3, 100.0
"""Readings left out, and chi-square per degree of freedom, that the other table may leave."""
Pairs = Mapping[tuple[str, str], Array]


def stretched(run: Run) -> Mended | None:
    """One scale for all distances, on the platform and on the base."""
    read, stated = [], []
    for nests in (run.header.platform_nests, run.header.base_nests):
        for pair, found in distances(run, nests).items():
            read.append(float(np.median(found)))
            stated.append(_stated(nests, pair))
    if len(read) < LEAST:
        return None
    ratios = np.array(read) / np.array(stated)
    scale = float(np.average(ratios, weights=np.square(stated)))
    off = abs(scale - 1.0)
    if off < SCALED or np.ptp(ratios) > ALIKE * off:
        return None
    return Mended(
        replace(run, position=run.position / scale),
        Remark(
            "points-scaled",
            f"x, y, z are scaled: all distances between nests are read {scale:.6f} times as long "
            "as they are stated",
            (),
            f"{ratios.size} distances agree on it within {np.ptp(ratios):.1g}",
            "Read with that scale taken back",
            "Export the readings as measured: without a best fit that scales, with the tracker's "
            "own temperature and pressure; or see the unit of the nest tables",
            True,
            run.source,
        ),
    )


def other_shape(machine: Machine, run: Run) -> Mended | None:
    """A table whose distances are not those that are read, where that explains a misfit."""
    before = fit_of(machine, run)
    for key in ("platform", "base"):
        nests = run.header.platform_nests if key == "platform" else run.header.base_nests
        read = distances(run, nests)
        off = {
            pair: float(np.median(found)) - _stated(nests, pair)
            for pair, found in read.items()
            if _clear(found, _stated(nests, pair))
        }
        table = _table(nests, read) if off else None
        if table is None:
            continue
        meant = placed(machine, with_table(run, key, table), key)
        after = fit_of(machine, meant)
        if before is None or after is None or excess(after) > (1.0 - FALL) * excess(before):
            continue
        if len(after.bad) > MOST_BAD or after.chi2_per_dof > LOUDEST:
            continue  # nests that moved against one another while they were read
        return Mended(meant, _shape_remark(run, key, off, read))
    return None


def with_table(run: Run, key: str, table: Mapping[str, Array]) -> Run:
    """The run with another table of nests, ``platform`` or ``base``."""
    changed: dict[str, Any] = {f"{key}_nests": dict(table)}
    return replace(run, header=replace(run.header, **changed))


def placed(machine: Machine, run: Run, key: str) -> Run:
    """The run with one table, ``platform`` or ``base``, moved rigidly to where a fit wants it."""
    fitted = fit_of(machine, run)
    if fitted is None:
        return run
    fitted = with_the_excluded(fitted)
    rows, situation = fitted.model.rows, fitted.linear.situation
    motions = rigid_motions(rows.nest) * (rows.on_platform == (key == "platform"))
    if key == "platform":
        motions = np.stack([rotate(situation.rotation, one) for one in motions])
    columns = np.einsum("ijn,kjn->kin", situation.whitened_frame, motions)
    moved = scan(fitted, columns[:, :, fitted.accepted]).sizes[0]
    nests = run.header.platform_nests if key == "platform" else run.header.base_nests
    turn = exponential(moved[3:])
    return with_table(run, key, {name: turn @ at + moved[:3] for name, at in nests.items()})


def distances(run: Run, nests: Mapping[str, Array]) -> Pairs:
    """Distances read between pairs of nests, mm, each pair at one stop of the machine."""
    stops: dict[tuple[str, bytes], dict[str, Array]] = {}
    for row in np.flatnonzero(run.measured):
        if run.nest[row] in nests:
            stop = stops.setdefault((run.pose[row], run.q[:, row].tobytes()), {})
            stop.setdefault(run.nest[row], run.position[:, row])
    found: dict[tuple[str, str], list[float]] = {}
    for stop in stops.values():
        for pair in combinations(sorted(stop), 2):
            apart = float(np.linalg.norm(stop[pair[0]] - stop[pair[1]]))
            found.setdefault(pair, []).append(apart)
    return {
        pair: np.array(read)
        for pair, read in found.items()
        if _stated(nests, pair) > 0.0 and (len(read) >= LEAST or len(stops) < LEAST)
    }


def _stated(nests: Mapping[str, Array], pair: tuple[str, str]) -> float:
    return float(np.linalg.norm(nests[pair[0]] - nests[pair[1]]))


def _clear(read: Array, stated: float) -> bool:
    off = float(np.median(read)) - stated
    spread = 1.5 * float(np.median(np.abs(read - np.median(read)))) / np.sqrt(read.size)
    return bool(abs(off) > max(OFF_MM, CLEAR * spread))


def _table(nests: Mapping[str, Array], read: Pairs) -> dict[str, Array] | None:
    """The table with the shape that the distances have, as near to the stated one as it can be."""
    names = sorted({name for pair in read for name in pair})
    if len(names) < 3 or any(pair not in read for pair in combinations(names, 2)):
        return None
    squared = np.zeros((len(names), len(names)))
    for (a, b), found in read.items():
        i, j = names.index(a), names.index(b)
        squared[i, j] = squared[j, i] = float(np.median(found)) ** 2
    centre = np.eye(len(names)) - 1.0 / len(names)
    values, vectors = np.linalg.eigh(-0.5 * centre @ squared @ centre)
    points = np.zeros((3, len(names)))
    kept = np.argsort(-values)[: min(3, len(names))]
    points[: kept.size] = np.sqrt(np.maximum(values[kept], 0.0))[:, None] * vectors[:, kept].T
    stated = np.array([nests[name] for name in names]).T
    best: Array | None = None
    for flip in (1.0, -1.0):
        shape = np.array([[1.0], [1.0], [flip]]) * points
        rotation, position = align(shape, stated)
        placed = rotation @ shape + position[:, None]
        if best is None or np.sum((placed - stated) ** 2) < np.sum((best - stated) ** 2):
            best = placed
    assert best is not None
    return {**nests, **{name: best[:, k] for k, name in enumerate(names)}}


def _shape_remark(run: Run, key: str, off: Mapping[tuple[str, str], float], read: Pairs) -> Remark:
    told = ", ".join(f"{a} to {b} {value:+.3f} mm" for (a, b), value in list(off.items())[:4])
    common = set.intersection(*(set(pair) for pair in off))
    rest = {pair for pair in read if not common & set(pair)}
    alone = f" nest {next(iter(common))} alone," if len(common) == 1 and rest else ""
    return Remark(
        "nest-table",
        f"[nests.{key}] is not the table of this {key}:{alone} distances between nests are read "
        f"otherwise than it states ({told})",
        (),
        "Nests on one body keep their distances, whatever the machine does",
        "Fitted with the nests as far apart as they were read; where the table as a whole sits is "
        "taken from the one stated",
        f"Write the table that belongs to this {key}: see its serial number; measure the nests "
        "again if one was moved",
        False,
        run.source,
    )
