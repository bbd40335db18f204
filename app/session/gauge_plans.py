"""The plans of a gauge: touch a surface at places, read a bar between nests, measure a part.

A place is approached and left along the direction of the gauge (``LIFTED`` behind its label). At
the first place, and wherever a number comes a second time, the platform is lifted a little
(``RAISED``): a gauge that is alive says so, with its sign and its unit. A probe that only says
whether it touches is lowered from above, at most to ``DEEPEST``.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from app.files.pose_table import Pose
from app.files.site import Site
from app.files.site_gauge import GaugeSite
from app.session import kinds
from app.session.plan import Plan, PlanWriter
from app.session.spans import stays_in_range, within
from calib.errors import BadInput

LIFTED, RAISED, DEEPEST = "+", "^", "-"
"""Behind the label of a pose: lifted to move on, raised to see whether the gauge follows, as low as
a probe is lowered."""
RAISE_MM = 0.3
POSITION = {"x", "y", "z"}

Marks = Sequence[tuple[str, str]]


def gauge_steps(
    site: Site, gauge: GaugeSite, poses: Mapping[str, Pose], options: "Manner"
) -> tuple[tuple[str, ...], dict[str, Pose], PlanWriter]:
    """Expand a campaign with a gauge.

    Returns
    -------
    words, poses, plan
        What it is, in words; the poses of the plan, lifted ones among them; its steps.

    Raises
    ------
    BadInput
        For marks that are no poses, and poses at which nothing could be read.
    """
    plan = PlanWriter()
    for kind in (kinds.CONNECT, kinds.CHECK_PATH, kinds.GAUGE, kinds.DRIVES):
        plan.add(kind)
    if options.warm_up:
        plan.add(kinds.WARM_UP, says="wait until the machine is warm and steady")
    plan.add(kinds.HOME, "start")
    more = _lifted(site, gauge, poses)
    if options.marks:
        _part(plan, site, gauge, poses, options.marks, bool(more))
        what = f"{len(options.marks)} distances between marks"
    elif gauge.reads == "distance":
        what = f"{_bar(plan, site, gauge, poses, options)} distances"
    else:
        _places(plan, gauge, poses, options, bool(more))
        what = f"{len(poses)} places"
    plan.add(kinds.HOME, "end", "return to the home pose")
    plan.add(kinds.REST)
    return (what, gauge.name), {**poses, **more}, plan


class Manner:
    """How a campaign with a gauge is run: what :class:`app.session.plans.PlanOptions` says."""

    def __init__(
        self, *, by_pose: bool, again_every: int, cycles: int, warm_up: bool, marks: Marks
    ) -> None:
        self.by_pose, self.again_every, self.cycles = by_pose, again_every, cycles
        self.warm_up, self.marks = warm_up, tuple(marks)


def _lifted(site: Site, gauge: GaugeSite, poses: Mapping[str, Pose]) -> dict[str, Pose]:
    """Each pose lifted, raised or lowered; nothing where the machine cannot, or need not."""
    lifts = gauge.clearance_mm > 0.0 and set(site.machine.task.coordinates) >= POSITION
    if not lifts and gauge.search is not None:
        raise BadInput(
            "a probe that says whether it touches must be lowered, and this cannot be",
            place=site.source,
            remedy="See clearance_mm, and whether the machine is commanded x, y and z",
        )
    if not lifts:
        return {}
    heights = {LIFTED: gauge.clearance_mm}
    if gauge.search is None:
        heights[RAISED] = min(RAISE_MM, gauge.clearance_mm)
    else:
        heights[DEEPEST] = -gauge.search.below_mm
    return {
        f"{label}{sign}": _moved(pose, np.array(gauge.away) * height)
        for label, pose in poses.items()
        for sign, height in heights.items()
    }


def _moved(pose: Pose, by: np.ndarray) -> Pose:
    x, y, z, rx, ry, rz = pose
    return x + float(by[0]), y + float(by[1]), z + float(by[2]), rx, ry, rz


def _places(
    plan: PlanWriter, gauge: GaugeSite, poses: Mapping[str, Pose], options: Manner, lifts: bool
) -> None:
    """Touch every place; the first one again and again: its zero is to stay."""
    first, visited = next(iter(poses)), 0
    for cycle in range(1, options.cycles + 1):
        for label in poses:
            if visited and visited % options.again_every == 0:
                _place(plan, gauge, first, f"again-{visited}", cycle, options, lifts)
            _place(plan, gauge, label, "", cycle, options, lifts)
            if not visited and lifts and not gauge.by_hand and gauge.search is None:
                plan.add(
                    kinds.FOLLOWS, label, pose=f"{label}{RAISED}", of=label, nest=gauge.nest
                )  # fmt: skip
                plan.add(kinds.MOVE, f"{label}-up", "lift", pose=f"{label}{LIFTED}")
            visited += 1
    if visited > 1 and gauge.reads == "direction":
        _place(plan, gauge, first, "at-the-end", options.cycles, options, lifts)


def _place(
    plan: PlanWriter, gauge: GaugeSite, label: str, about: str, cycle: int, options: Manner,
    lifts: bool,
) -> None:  # fmt: skip
    """Come from above, read, lift again."""
    args: dict[str, Any] = {"cycle": cycle} if options.cycles > 1 else {}
    if lifts:
        args["above"] = f"{label}{LIFTED}"
        plan.add(kinds.MOVE, f"{label}-above", f"above place {label}", pose=args["above"])
    if about:
        args["again"] = True
    name = f"{label}-{about}" if about else label
    says = f"read place {label} again" if about else f"read place {label}"
    if gauge.search is None:
        plan.add(kinds.TOUCH, name, says, pose=label, nest=gauge.nest, **args)
    else:
        low = f"{label}{DEEPEST}"
        plan.add(kinds.PROBE, name, says, pose=low, of=label, nest=gauge.nest, **args)
    if lifts:
        plan.add(kinds.MOVE, f"{label}-up", "lift", pose=args["above"])


def _bar(
    plan: PlanWriter, site: Site, gauge: GaugeSite, poses: Mapping[str, Pose], options: Manner
) -> int:
    """Read each pair wherever it is in range; the bar stays on where the way keeps its range."""
    if not gauge.pairs:
        raise BadInput(
            "there is no nest on the base to which a distance could be read", place=site.source,
            remedy="Add [nests.base]; or name marks at two poses: --pair A:B",
        )  # fmt: skip
    visits = list(_visits(site, gauge, poses, options))
    if not visits:
        raise BadInput(
            f"no pose brings a pair of nests within what the gauge can show ({gauge.lowest:g} to "
            f"{gauge.highest:g} mm)",
            place=site.source,
            remedy="Choose poses for it: pkmcal poses --site SITE; or see zero_at",
        )
    before: tuple[str, tuple[str, str]] | None = None
    for label, pair, cycle in visits:
        stays = (
            before is not None and before[1] == pair
            and (before[0] == label or stays_in_range(site, gauge, poses, pair, before[0], label))
        )  # fmt: skip
        args = {"cycle": cycle} if options.cycles > 1 else {}
        plan.add(
            kinds.TOUCH, f"{label}-{pair[0]}-{pair[1]}", f"read {pair[0]} to {pair[1]} at {label}",
            pose=label, nest=pair[0], nest2=pair[1], stays=stays, **args,
        )  # fmt: skip
        before = (label, pair)
    plan.add(kinds.APART)
    return len(visits)


def _visits(
    site: Site, gauge: GaugeSite, poses: Mapping[str, Pose], options: Manner
) -> Iterator[tuple[str, tuple[str, str], int]]:
    """Pose, pair, cycle: pair by pair, or all pairs at each pose."""
    for cycle in range(1, options.cycles + 1):
        both = (
            [(label, pair) for label in poses for pair in gauge.pairs]
            if options.by_pose
            else [(label, pair) for pair in gauge.pairs for label in poses]
        )
        for label, pair in both:
            if within(site, gauge, poses[label], pair):
                yield label, pair, cycle


def _part(
    plan: PlanWriter, site: Site, gauge: GaugeSite, poses: Mapping[str, Pose], marks: Marks,
    lifts: bool,
) -> None:  # fmt: skip
    """Leave a mark at every pose that is named; then measure between them."""
    if gauge.reads != "distance":
        raise BadInput(
            f"marks are measured with a distance, the gauge reads a {gauge.reads}",
            place=site.source, remedy='Write reads = "distance", or leave --pair out',
        )  # fmt: skip
    strange = [one for pair in marks for one in pair if one not in poses]
    if strange:
        raise BadInput(
            f'there is no pose "{strange[0]}"', place="--pair", remedy=f"Known: {', '.join(poses)}"
        )
    tool = next(iter(site.platform_nests))
    for label in dict.fromkeys(one for pair in marks for one in pair):
        plan.add(kinds.MARK, label, pose=label)
    plan.add(kinds.HOME, "part", "home, for the part to be taken out")
    for one, two in marks:
        plan.add(kinds.BETWEEN, f"{one}-{two}", pose=one, pose2=two, nest=tool, nest2=tool)


def plan_of(
    site: Site, poses: Mapping[str, Pose], options: Manner, purpose: str, title: str
) -> Plan:
    """The plan of a site with a gauge; raises BadInput."""
    gauge = site.gauge
    if gauge is None or purpose != "measure":
        raise BadInput(
            f"a gauge cannot {purpose}", place=site.source, remedy="Name a site with a tracker"
        )
    words, all_poses, plan = gauge_steps(site, gauge, poses, options)
    title = title or f"{site.machine.name}, {words[0]}, {words[1]}"
    return Plan(purpose, title, site.machine_name, all_poses, tuple(plan.steps))
