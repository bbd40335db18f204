"""A nest table in other axes: turned by right angles, or with two axes exchanged."""

from dataclasses import replace
from functools import partial
from itertools import permutations, product

import numpy as np

from calib.arrays import Array
from calib.identify.alignment import robust_align
from calib.look.places import Places
from calib.look.proposal import Proposal
from calib.runs.record import Run
from calib.runs.remark import Remark


def turned_table(places: Places) -> Proposal | None:
    """The axes of the platform's table, or of the base's, with which almost all readings fit."""
    best: Proposal | None = None
    nests, on = places.rows.nest, places.rows.on_platform
    for platform, axes in product((True, False), _axes()):
        which = on == platform
        if not which.any():
            continue
        table = np.where(which, axes @ nests, nests)
        if np.allclose(table, nests):
            continue
        base = places.with_nests(table)
        frame = places.from_base if platform else places.majority[0]
        if frame is None:
            inside = robust_align(base, places.seen, places.slack)[2]
        else:
            inside = places.inside(frame, base)
        count = int(inside.sum())
        if count < places.rows.count - places.limit:
            continue
        if best is None or count > best.explained:
            best = Proposal(count, partial(_turned, places, axes, platform))
    return best


def _axes() -> list[Array]:
    """The 47 signed permutations (3, 3) but for the identity, the plainest first."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            axes = np.zeros((3, 3))
            axes[range(3), order] = signs
            if not np.allclose(axes, np.eye(3)):
                found.append(axes)
    return sorted(found, key=lambda axes: (int(np.sum(axes < 0)), np.linalg.det(axes) < 0))


def _turned(places: Places, axes: Array, platform: bool) -> tuple[Run, Remark]:
    run, table = places.run, "platform" if platform else "base"
    header = run.header
    old = header.platform_nests if platform else header.base_nests
    moved = {name: axes @ nest for name, nest in old.items()}
    changed = (
        replace(header, platform_nests=moved) if platform else replace(header, base_nests=moved)
    )
    mirrored = bool(np.linalg.det(axes) < 0.0)
    told = ", ".join(
        f"{to} is the table's {'-' if sign < 0 else ''}{'xyz'[int(np.argmax(np.abs(row)))]}"
        for to, row in zip("xyz", axes, strict=True)
        if (sign := float(row.sum()))
    )
    how = "mirrored (left-handed)" if mirrored else "in axes turned by right angles"
    return replace(run, header=changed), Remark(
        "nests-mirrored" if mirrored else "nests-turned",
        f"[nests.{table}] is {how}: {told}",
        (),
        "In those axes the readings stand in their nests, as it is written they do not",
        f"Fitted with [nests.{table}] in those axes; nothing is excluded for it",
        f"Give [nests.{table}] in the axes of the machine file",
        True,
        run.source,
    )
