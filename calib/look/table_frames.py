"""A nest table in a frame of its own: that of a drawing, turned and moved as a whole.

By far it is seen against the nominal machine, by less in what a fit leaves.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.tracker import rigid_motions
from calib.frames import Frame
from calib.identify.alignment import collinear, robust_align
from calib.identify.fitting import Fit
from calib.look.bent import Mended
from calib.look.places import Places
from calib.look.proposal import Proposal
from calib.look.scan import excess, fit_of, scan
from calib.look.seats import ALONG, normal_of, radii_in_words
from calib.mechanism.description import Machine
from calib.mechanism.rigid import exponential, logarithm, rotate
from calib.runs.record import Run
from calib.runs.remark import Remark

LEAST = 4
"""Readings in nests of a table that tell where it is."""
ENOUGH = 0.9
"""Part of them that must agree on it."""
LATER = 0.1
"""Part of the readings on the platform that must lie between two visits of the base.

A tracker that was moved after the only one looks like a table in another frame.
"""
FALL, SHARE = 100.0, 0.9
"""Least fall of the cost by which a table is moved by what a fit leaves, and part of the misfit."""
SMALLEST_MM = 0.3
"""Offset of a whole table, mm, below which it is a matter of tolerances."""
FITS = 3
"""Motions of a table, one after the other: the first is bent by the geometry."""
FAR_MM = 50.0
"""Shift, mm, of a table that is not turned, from which on it is asked here."""
TURNED_RAD = 0.1
"""Turn below which a table is asked of in what a fit leaves: actuators off turn a platform, too."""
RIGHT_RAD, SAME_MM = 0.02, 1.0
"""Turn, and shift in mm, within which a table is the stated one, if in exchanged axes."""


def framed_table(places: Places) -> Proposal | None:
    """The rigid motion of the platform's table, or of the base's, with which readings fit it."""
    best: Proposal | None = None
    on = places.rows.on_platform
    for which, platform in ((on, True), (~on, False)):
        frame = places.from_base if platform else _from_platform(places)
        if frame is None or which.sum() < LEAST or not (platform or _come_back(on)):
            continue
        nests, own = places.rows.nest[:, which], places.in_nest_frame(frame)[:, which]
        if collinear(nests):
            continue
        turn, shift, fits = robust_align(nests, own, places.slack[which])
        if fits.mean() < ENOUGH or _plain(turn, shift):
            continue
        explained = int(fits.sum() + places.inside(frame)[~which].sum())
        if best is None or explained > best.explained:
            best = Proposal(explained, partial(_taken, places, turn, shift, platform))
    return best


def _from_platform(places: Places) -> tuple[Array, Array] | None:
    """The frame in which the readings on the platform stand in their nests."""
    on = places.rows.on_platform
    if not on.any() or collinear(places.base[:, on]):
        return None
    rotation, position, fits = robust_align(
        places.base[:, on], places.seen[:, on], places.slack[on]
    )
    return (rotation, position) if fits.mean() >= ENOUGH else None


def _come_back(on: BoolArray) -> bool:
    """Whether the base was read again after a good part of the readings on the platform."""
    before = np.cumsum(on)[~on]
    return bool(np.ptp(before) > LATER * on.sum())


def _plain(turn: Array, shift: Array) -> bool:
    """Whether the table is moved by nothing, or is in axes that are exchanged alone."""
    if float(np.linalg.norm(logarithm(turn))) < TURNED_RAD:
        return float(np.linalg.norm(shift)) < FAR_MM  # what a fit leaves tells that better
    square = np.round(turn)
    if not np.array_equal(np.abs(square).sum(axis=0), np.ones(3)):
        return False
    off = float(np.linalg.norm(logarithm(square.T @ turn)))
    return off < RIGHT_RAD and float(np.linalg.norm(shift)) < SAME_MM


def _taken(places: Places, turn: Array, shift: Array, platform: bool) -> tuple[Run, Remark]:
    run, header = places.run, places.run.header
    table = header.platform_nests if platform else header.base_nests
    moved = {name: turn @ at + shift for name, at in table.items()}
    header = (
        replace(header, platform_nests=moved) if platform else replace(header, base_nests=moved)
    )
    key = "platform" if platform else "base"
    told = ", ".join(f"{value:.4g}" for value in shift)
    angles = ", ".join(f"{np.degrees(value):.3g}" for value in Frame(turn, shift).numbers()[3:])
    return replace(run, header=header), Remark(
        "nests-frame",
        f"[nests.{key}] is in another frame than that of the machine file: its axes are turned by "
        f"rx, ry, rz = {angles} deg against the machine's, its origin lies at {told} mm there",
        (),
        "Moved as a whole the nests are where they were read, each by itself they are not",
        f"Fitted with [nests.{key}] moved so; nothing is excluded for it",
        f"Give [nests.{key}] in the frame of the machine file, SMR centres",
        True,
        run.source,
    )


def table_frame(machine: Machine, run: Run, fitted: Fit) -> Mended | None:
    """All nests of the platform, or of the base, off by one amount, or turned as a whole."""
    for turned in (False, True):
        best = _best_frame(fitted, turned=turned)
        if best is None or best[0] < max(FALL, SHARE * excess(fitted)):
            continue
        _, platform, motion = best
        size = float(np.linalg.norm(motion[:3] if not turned else _moved(fitted, best)))
        if size < SMALLEST_MM:
            continue
        meant = run
        for again in range(FITS):
            meant = _shifted(meant, motion, platform=platform)
            left = fit_of(machine, meant) if again < FITS - 1 else None
            if left is None:
                break
            motion = scan(left, _columns(left, platform=platform, turned=turned)).sizes[0]
        return Mended(meant, _frame_remark(run, meant, platform=platform, turned=turned))
    return None


def _best_frame(fitted: Fit, *, turned: bool) -> tuple[float, bool, Array] | None:
    """Fall, table (the platform's?) and motion (3,) or (6,) of the table that explains more."""
    rows = fitted.model.rows
    best: tuple[float, bool, Array] | None = None
    for platform in (True, False):
        which = rows.on_platform == platform
        if not which[fitted.accepted].any() or which[fitted.accepted].all():
            continue
        tried = scan(fitted, _columns(fitted, platform=platform, turned=turned))
        if best is None or tried.fall[0] > best[0]:
            best = (float(tried.fall[0]), platform, tried.sizes[0])
    return best


def _moved(fitted: Fit, found: tuple[float, bool, Array]) -> Array:
    """How far (3,) the nest goes that goes farthest."""
    rows = fitted.model.rows
    nests = rows.nest[:, rows.on_platform == found[1]]
    far = np.tensordot(found[2], rigid_motions(nests), axes=1)
    return np.asarray(far[:, np.argmax(np.linalg.norm(far, axis=0))])


def _columns(fitted: Fit, *, platform: bool, turned: bool) -> Array:
    """Whitened columns (3 or 6, 3, A) of moving all nests of a table, in its frame."""
    situation, rows = fitted.linear.situation, fitted.model.rows
    motions = rigid_motions(rows.nest)[: 6 if turned else 3] * (rows.on_platform == platform)
    if platform:
        motions = np.stack([rotate(situation.rotation, one) for one in motions])
    whitened = np.einsum("ijn,kjn->kin", situation.whitened_frame, motions)
    return np.asarray(whitened[:, :, fitted.accepted], dtype=np.float64)


def _shifted(run: Run, motion: Array, *, platform: bool) -> Run:
    header = run.header
    table = header.platform_nests if platform else header.base_nests
    turn = exponential(motion[3:]) if motion.size > 3 else np.eye(3)
    moved = {nest: turn @ place + motion[:3] for nest, place in table.items()}
    if platform:
        return replace(run, header=replace(header, platform_nests=moved))
    return replace(run, header=replace(header, base_nests=moved))


def _frame_remark(run: Run, meant: Run, *, platform: bool, turned: bool) -> Remark:
    table = "platform" if platform else "base"
    before = run.header.platform_nests if platform else run.header.base_nests
    after = meant.header.platform_nests if platform else meant.header.base_nests
    off = np.stack([after[name] - before[name] for name in before])
    offset = off.mean(axis=0)
    size = float(np.linalg.norm(offset))
    told = ", ".join(f"{value:+.3f}" for value in offset)
    if turned:
        most = float(np.linalg.norm(off, axis=1).max())
        says = (
            f"All nests of [nests.{table}] are off together, by up to {most:.3g} mm: the table is "
            "turned as a whole, given in other axes"
        )
    else:
        says = (
            f"All nests of [nests.{table}] are off by {size:.3g} mm alike ({told} mm): they are "
            "given from another origin"
        )
    along = abs(float(normal_of(run.header) @ offset)) if platform else abs(float(offset[2]))
    if not turned and along > ALONG * size:
        says += f", or read with SMRs of another size than the others{radii_in_words(along)}"
    return Remark(
        "nests-frame",
        says,
        (),
        "No machine within its tolerances is so far off; with the table moved by that it is within "
        "them",
        "Fitted with the table moved by that",
        f"Give [nests.{table}] in the frame of the machine file, SMR centres",
        True,
        run.source,
    )
