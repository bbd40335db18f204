"""The plans that operators run: measure poses, in either order, verify, and warm a machine up."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from app.devices import kind_named
from app.files.pose_table import Pose
from app.files.site import Site
from app.session import kinds
from app.session.gauge_plans import Manner, plan_of
from app.session.plan import Plan, PlanWriter
from calib.errors import BadInput

Order = Literal["nest-by-nest", "pose-by-pose"]
EXERCISE_MIN = 5.0
"""Of a machine that warms up, one step."""


@dataclass(frozen=True)
class PlanOptions:
    """How a campaign is run.

    ``reference_every`` counts poses between two looks at the base nests. ``order``: carry one SMR
    from nest to nest and visit all poses with each, or hold SMRs in all nests and let the tracker
    re-point at each pose. ``cycles`` repeats the poses (ISO 9283).
    """

    order: Order = "nest-by-nest"
    reference_every: int = 10
    cycles: int = 1
    warm_up: bool = True
    two_face: bool = True
    nests: tuple[str, ...] = ()
    """Platform nests to use; all of the site's if empty."""
    truth: bool = False
    """Ask a mock's control socket for the true pose at each pose: for judges only."""
    title: str = ""
    marks: tuple[tuple[str, str], ...] = ()
    """With a gauge: pairs of poses, where marks are left, between which it measures."""


def measure_plan(
    site: Site, poses: Mapping[str, Pose], options: PlanOptions, purpose: str = "measure"
) -> Plan:
    """Expand a campaign into steps.

    Raises
    ------
    BadInput
        If there are no poses, or fewer SMRs than the order needs.
    """
    if not poses:
        raise BadInput("no poses to measure", remedy="Give a poses file with at least one pose")
    if site.gauge is not None:
        manner = Manner(
            by_pose=options.order == "pose-by-pose", again_every=options.reference_every,
            cycles=options.cycles, warm_up=options.warm_up, marks=options.marks,
        )  # fmt: skip
        return plan_of(site, poses, manner, purpose, options.title)
    if options.marks:
        raise BadInput(
            "marks are measured by a gauge, the site has a tracker",
            place=site.source, remedy="Leave --pair out",
        )  # fmt: skip
    nests = _nests(site, options)
    if options.truth and site.hands.kind != "mock":
        raise BadInput("only a mock machine knows the truth", remedy="Leave --truth out")
    if options.order == "pose-by-pose" and site.hands.smrs < len(nests):
        raise BadInput(
            f"pose by pose needs an SMR in each of the {len(nests)} platform nests, the site has "
            f"{site.hands.smrs}",
            place=site.source,
            remedy="Set hands.smrs, or measure nest by nest",
        )
    plan = PlanWriter()
    _prepare(plan, options)
    _reference(plan, site, "start")
    if options.two_face:
        plan.add(kinds.TWO_FACE, "start")
    if options.order == "nest-by-nest":
        _nest_by_nest(plan, site, poses, options)
    else:
        _pose_by_pose(plan, site, poses, options)
    plan.add(kinds.HOME, "end", "return to the home pose")
    _reference(plan, site, "end")
    if options.two_face:
        plan.add(kinds.TWO_FACE, "end")
    plan.add(kinds.REST)
    title = options.title or f"{site.machine.name}, {len(poses)} poses, {len(nests)} nests"
    return Plan(purpose, title, site.machine_name, dict(poses), tuple(plan.steps))


def warming_plan(site: Site, poses: Mapping[str, Pose], minutes: float) -> Plan:
    """Keep the machine moving between poses, so that it gets as warm as it is when it is used.

    In steps of five minutes: a session that is gone on with does what is left.

    Raises
    ------
    BadInput
        Without poses, and for no time.
    """
    if not poses or not minutes > 0.0:
        raise BadInput(
            f"{len(poses)} poses in {minutes:g} min warm nothing up",
            remedy="Give poses, and a time of more than 0 min",
        )
    plan = PlanWriter()
    for kind in (kinds.CONNECT, kinds.CHECK_PATH, kinds.DRIVES):
        plan.add(kind)
    parts = math.ceil(minutes / EXERCISE_MIN)
    for part in range(1, parts + 1):
        begins, ends = EXERCISE_MIN * (part - 1), min(EXERCISE_MIN * part, minutes)
        says = f"keep the machine moving, minutes {begins:g} to {ends:g}"
        plan.add(kinds.EXERCISE, str(part), says, minutes=ends - begins, poses=list(poses))
    plan.add(kinds.HOME, "end", "return to the home pose")
    plan.add(kinds.REST)
    title = f"{site.machine.name}, {minutes:g} min of warming up"
    return Plan("warming", title, site.machine_name, dict(poses), tuple(plan.steps))


def _prepare(plan: PlanWriter, options: PlanOptions) -> None:
    plan.add(kinds.CONNECT)
    plan.add(kinds.CHECK_PATH)
    plan.add(kinds.TRACKER)
    plan.add(kinds.DRIVES)
    if options.warm_up:
        plan.add(kinds.WARM_UP)
    plan.add(kinds.HOME, "start")


def _reference(plan: PlanWriter, site: Site, about: str) -> None:
    """Read every base nest, then judge the drift (or find the base frame, the first time)."""
    for nest in site.base_nests:
        plan.add(kinds.REFERENCE, f"{about}-{nest}", nest=nest)
    says = "find the base in the tracker's frame" if about == "start" else ""
    plan.add(kinds.DRIFT, about, says, nests=list(site.base_nests), group=about)


def _nest_by_nest(
    plan: PlanWriter, site: Site, poses: Mapping[str, Pose], options: PlanOptions
) -> None:
    visited = 0
    for nest in _nests(site, options):
        plan.add(kinds.HOME, f"nest-{nest}", "home, for the SMR to be carried")
        plan.add(kinds.CARRY, nest, f"SMR into nest {nest}", nest=nest, smr=1)
        plan.add(kinds.CONFIRM, nest, nest=nest)
        if not visited:
            _directions(plan, site, nest)
        for cycle in range(1, options.cycles + 1):
            for label in poses:
                if visited and visited % options.reference_every == 0:
                    _reference(plan, site, f"after-{visited}")
                plan.add(kinds.MOVE, f"{label}-{nest}", pose=label)
                _read(plan, label, nest, cycle, options)
                visited += 1


def _pose_by_pose(
    plan: PlanWriter, site: Site, poses: Mapping[str, Pose], options: PlanOptions
) -> None:
    nests = _nests(site, options)
    plan.add(kinds.HOME, "carry", "home, for the SMRs to be carried")
    for smr, nest in enumerate(nests, start=1):
        plan.add(kinds.CARRY, nest, nest=nest, smr=smr)
    for nest in nests:
        plan.add(kinds.CONFIRM, nest, nest=nest)
    _directions(plan, site, nests[0])
    visited = 0
    for cycle in range(1, options.cycles + 1):
        for label in poses:
            if visited and visited % options.reference_every == 0:
                _reference(plan, site, f"after-{visited}")
            plan.add(kinds.MOVE, label, pose=label)
            # Back and forth: the beam is already on the nest that was read last.
            for nest in nests if visited % 2 == 0 else reversed(nests):
                _read(plan, label, nest, cycle, options)
            if options.truth:
                plan.add(kinds.TRUTH, label, pose=label)
            visited += 1


def _directions(plan: PlanWriter, site: Site, nest: str) -> None:
    """Drives alone know nothing of the machine: what they move is looked at before a large move."""
    if kind_named("controller", site.controller.kind).takes == "actuators":
        plan.add(kinds.DIRECTIONS, nest, nest=nest)


def _nests(site: Site, options: PlanOptions) -> list[str]:
    """Platform nests that are used; raises BadInput for one that the site has not."""
    for nest in options.nests:
        if nest not in site.platform_nests:
            raise BadInput(
                f'no platform nest "{nest}"',
                place=site.source,
                remedy=f"Its nests are {', '.join(site.platform_nests)}",
            )
    return list(options.nests or site.platform_nests)


def order_for(site: Site) -> Order:
    """Pose by pose where there are SMRs enough, else nest by nest."""
    if site.gauge is not None:
        return "nest-by-nest"
    enough = site.hands.smrs >= len(site.platform_nests)
    return "pose-by-pose" if enough else "nest-by-nest"


def _read(plan: PlanWriter, label: str, nest: str, cycle: int, options: PlanOptions) -> None:
    args: dict[str, Any] = {"cycle": cycle} if options.cycles > 1 else {}
    plan.add(kinds.READ, f"{label}-{nest}", pose=label, nest=nest, **args)


def pose_labels(poses: Sequence[Pose]) -> dict[str, Pose]:
    """Label poses by their number."""
    return {str(number): pose for number, pose in enumerate(poses, start=1)}
