"""Readings of which some are written otherwise than the rest: axes exchanged, signs, thousands.

A reading that stands in no nest is tried in the other ways in which its numbers may have been
written, in the frame that most readings share. What brings it to its own nest, within the slack of
the machine's tolerances and metres from where it was written, is no chance.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product

import numpy as np

from calib.arrays import Array, BoolArray
from calib.look.places import Places
from calib.look.proposal import Proposal
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

LEAST = 2
"""Readings that one other way of writing must bring to their nests."""
ENOUGH = 0.9
"""Part of all readings that must stand in their nests then, or half of them before."""
SCALES = ((1000.0, "m, or lost its thousands"), (25.4, "inches"))


@dataclass(frozen=True, eq=False)
class _Writing:
    """A way of writing points: ``axes`` (3, 3) brings them back."""

    name: str
    says: str
    remedy: str
    axes: Array


def rewritten(places: Places) -> Proposal | None:
    """The one other way of writing that brings most of the other readings to their nests."""
    frame, inside = places.majority
    outside = np.flatnonzero(~inside)
    if outside.size < LEAST:
        return None
    rotation, position = frame
    meant = rotation @ places.base[:, outside] + position[:, None]
    seen, slack = places.seen[:, outside], places.slack[outside]
    best: Proposal | None = None
    for writing in _writings():
        fits = np.linalg.norm(writing.axes @ seen - meant, axis=0) < slack
        explained = int(inside.sum() + fits.sum())
        if fits.sum() < LEAST or max(2 * inside.sum(), explained) < ENOUGH * inside.size:
            continue
        if best is None or explained > best.explained:
            which = np.zeros_like(inside)
            which[outside[fits]] = True
            best = Proposal(explained, partial(_taken, places, writing, which))
    return best


def _writings() -> Iterator[_Writing]:
    for axis, name in enumerate("xyz"):
        for factor, unit in SCALES:
            scale = np.eye(3)
            scale[axis, axis] = factor
            yield _Writing("points-unit", f"{name} looks like {unit}", f"Write {name} in mm", scale)
        flip = np.eye(3)
        flip[axis, axis] = -1.0
        yield _Writing(
            "points-sign", f"{name} has the wrong sign", f"Turn the sign of {name} round", flip
        )
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            axes = np.zeros((3, 3))
            axes[range(3), order] = signs
            if np.count_nonzero(np.diag(axes)) == 3 and sum(signs) >= 1.0:
                continue  # as it is, or with one sign
            told = ", ".join(
                f"{to} stands in {'-' if sign < 0 else ''}{'xyz'[at]}"
                for to, at, sign in zip("xyz", order, signs, strict=True)
                if to != "xyz"[at] or sign < 0
            )
            yield _Writing(
                "points-axes", f"the axes are others: {told}",
                "Write x, y, z of all rows in the same axes", axes,
            )  # fmt: skip


def _taken(places: Places, writing: _Writing, which: BoolArray) -> tuple[Run, Remark]:
    run = places.run
    rows = np.flatnonzero(run.measured)[which]
    position, covariance = run.position.copy(), run.covariance.copy()
    position[:, rows] = writing.axes @ position[:, rows]
    if writing.name == "points-axes":
        turned = np.einsum("ij,jkn,lk->iln", writing.axes, covariance[:, :, rows], writing.axes)
        covariance[:, :, rows] = turned
    lines = ranges(run.line[rows], run.line[run.measured])
    return replace(run, position=position, covariance=covariance), Remark(
        writing.name,
        f"In {lines_in_words(lines)} {writing.says}",
        lines,
        f"So {rows.size} readings stand in their nests, as they are written they stand in none",
        "Read so; nothing is excluded for it",
        writing.remedy,
        True,
        run.source,
    )
