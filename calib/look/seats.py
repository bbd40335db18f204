"""A nest whose SMR sits elsewhere than the table says: an SMR of another size, or another hole."""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.identify.alignment import collinear, robust_align
from calib.look.places import Places
from calib.look.proposal import Proposal
from calib.runs.header import Header
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

LEAST = 4
"""Readings of a nest that must be off alike."""
MOST_MM = 500.0
"""Offset, mm, beyond which no number was mistyped."""
ALONG = 0.95
"""Part of an offset along the normal of the nests from which on it is the SMR's size."""
CLEARLY = 0.99
"""Part of the scatter in one frame that is left in the other, where that is the one."""
RADII = {"1.5 inch": 19.05, "7/8 inch": 11.1125, "0.5 inch": 6.35, "30 mm": 15.0, "20 mm": 10.0}
"""Radii of SMRs that are sold, mm."""
MATCH = 0.15
"""How near (mm) a difference of radii must be to be named."""


def displaced_seat(places: Places) -> Proposal | None:
    """The nest that is off as one, in the whole run or on one side of some reading."""
    best: Proposal | None = None
    names = np.array(places.rows.nest_name, dtype=object)
    for name in places.run.header.platform_nests:
        own = names == name
        if own.sum() < LEAST or collinear(places.base[:, ~own]):
            continue
        others = ~own
        rotation, position, inside = robust_align(
            places.base[:, others], places.seen[:, others], places.slack[others]
        )
        back = places.in_nest_frame((rotation, position)) - places.rows.nest
        off = np.linalg.norm(back, axis=0) >= places.slack
        which = _one_side(own, off)
        if which.sum() < LEAST:
            continue
        middle = np.median(back[:, which], axis=1)
        if np.linalg.norm(middle) > MOST_MM:
            continue
        fits = which & (np.linalg.norm(back - middle[:, None], axis=0) < places.slack)
        explained = int(inside.sum() + (own & ~off & ~which).sum() + fits.sum())
        if fits.sum() >= 0.9 * which.sum() and (best is None or explained > best.explained):
            best = Proposal(explained, partial(_taken, places, name, which, back, rotation))
    return best


def _taken(
    places: Places, name: str, which: BoolArray, back: Array, rotation: Array
) -> tuple[Run, Remark]:
    """The SMR off alike in the platform frame, or in that of the base: where it scatters less.

    ``back`` (3, N) is how far off it is, platform frame; which is meant where nothing turns.
    """
    lines, own = places.rows.line[which], back[:, which]
    room = np.einsum("ijn,jn->in", places.rotation[:, :, which], own)
    if np.sum(np.var(room, axis=1)) < CLEARLY * np.sum(np.var(own, axis=1)):
        return lifted(places.run, name, lines, np.median(room, axis=1), rotation)
    return seated(places.run, name, lines, np.median(own, axis=1))


def _one_side(own: BoolArray, off: BoolArray) -> BoolArray:
    """Readings (N,) of a nest from the first to the last that is off, if most between are."""
    rows = np.flatnonzero(own & off)
    if rows.size == 0:
        return own & off
    span = own.copy()
    span[: rows[0]] = span[rows[-1] + 1 :] = False
    return span if rows.size >= 0.8 * span.sum() else own & off


def seated(run: Run, name: str, lines: IntArray, offset: Array) -> tuple[Run, Remark]:
    """The run with the nest moved by ``offset`` (3,), platform frame, in the given lines."""
    at = np.isin(run.line, lines) & run.measured
    whole = _whole(run, name, at)
    seat = name if whole else _free_name(run.header, name)
    nest = tuple(seat if here else old for here, old in zip(at, run.nest, strict=True))
    table = {**run.header.platform_nests, seat: run.header.platform_nests[name] + offset}
    remark = _remark(run, name, at, offset, normal_of(run.header))
    return replace(run, nest=nest, header=replace(run.header, platform_nests=table)), remark


def lifted(
    run: Run, name: str, lines: IntArray, offset: Array, rotation: Array
) -> tuple[Run, Remark]:
    """The run with readings of a nest taken back by ``offset`` (3,), the same in the base frame.

    ``rotation`` (3, 3) is that of the base in the tracker frame.
    """
    at = np.isin(run.line, lines) & run.measured
    position = run.position - np.outer(rotation @ offset, at)
    position[:, ~run.measured] = run.position[:, ~run.measured]
    remark = _remark(run, name, at, offset, np.array([0.0, 0.0, 1.0]))
    return replace(run, position=position), remark


def _whole(run: Run, name: str, at: BoolArray) -> bool:
    """Whether rows (N,) are all readings of a nest."""
    return int(at.sum()) == sum(
        nest == name for nest, read in zip(run.nest, run.measured, strict=True) if read
    )


def _remark(run: Run, name: str, at: BoolArray, offset: Array, normal: Array) -> Remark:
    along, size = float(normal @ offset), float(np.linalg.norm(offset))
    found = ranges(run.line[at], run.line[[n == name for n in run.nest]])
    where = "" if _whole(run, name, at) else f" in {lines_in_words(found)}"
    if abs(along) > ALONG * size:
        kind, (says, remedy) = "smr-size", _smr(name, where, along)
    else:
        shift = ", ".join(f"{value:+.3f}" for value in offset)
        kind, remedy = "nest-displaced", f"Check the hole of nest {name} and its numbers"
        says = (
            f"Nest {name}{where} is off by {size:.3g} mm ({shift} mm): another hole, or a wrong "
            "number in [nests.platform]"
        )
    return Remark(
        kind,
        says,
        found,
        f"{int(at.sum())} readings of this nest are off alike, those of the others are not",
        "Fitted with the SMR where it was read; nothing is excluded for it",
        remedy,
        True,
        run.source,
    )


def _smr(name: str, where: str, along: float) -> tuple[str, str]:
    says = (
        f"Nest {name}{where} was read with an SMR of another size: offset of nest {name} by "
        f"{along:+.3f} mm along its normal"
    )
    says += radii_in_words(abs(along))
    return says, f"Read nest {name} with the SMR of the others, or correct its height in the table"


def radii_in_words(height: float) -> str:
    """Which SMRs differ in radius by a height, mm, in brackets; empty if none do."""
    pairs = [
        (abs(abs(one - other) - height), f"{first} and {second}")
        for first, one in RADII.items()
        for second, other in RADII.items()
        if one > other
    ]
    miss, pair = min(pairs)
    return f" (SMRs of {pair} differ by that)" if miss < MATCH else ""


def normal_of(header: Header) -> Array:
    """Normal (3,) of the plane of the platform nests; z of the platform where there is none."""
    points = np.array(list(header.platform_nests.values())).T
    z = np.array([0.0, 0.0, 1.0])
    if points.shape[1] < 3:
        return z
    axes, spread, _ = np.linalg.svd(points - points.mean(axis=1)[:, None])
    if spread[1] < 1e-3 * spread[0] or spread[2] > 0.1 * spread[1]:
        return z
    normal = np.asarray(axes[:, 2], dtype=np.float64)
    return normal if normal @ z >= 0.0 else -normal


def _free_name(header: Header, name: str) -> str:
    """A name for the seat that is not in use."""
    seat = f"{name}*"
    while seat in header.platform_nests or seat in header.base_nests:
        seat += "*"
    return seat
