"""Plan the next measurements: those that tell two effects apart."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from app.analysis import load_refitter
from app.files.pose_table import Pose
from app.files.poses import full_poses, render_pose_file
from app.files.runs import outside_runs
from app.jobs.chosen_runs import File, Runs, at_least, names_of, path_of, paths_of
from app.jobs.posing import PoseEntry
from app.jobs.record import Report
from app.noisy import with_noise_of
from calib.defaults import FOLLOW_UP_FROM
from calib.discover.design import FollowUpPlan, design_follow_up
from calib.effects import effect_named
from calib.errors import BadInput
from calib.poses.design import labels_for
from calib.poses.margin import tolerance_margin
from calib.poses.path import check_path

NOTHING = "nothing"
SUFFICIENT = 0.8


@dataclass(frozen=True, kw_only=True)
class FollowUpReport(Report):
    """Poses that tell two effects apart (``pkm-follow-up/1``), in the order to measure them.

    ``right_now``, ``right_then``: probability of the right answer without and with them, by the
    effect that is true. ``conditions``: channels that must stand at a value meanwhile.
    """

    FORMAT: ClassVar[str] = "pkm-follow-up/1"
    machine: str
    discriminate: tuple[str, ...]
    model: tuple[str, ...]
    runs: tuple[str, ...]
    conditions: Mapping[str, float]
    right_now: Mapping[str, float]
    right_then: Mapping[str, float]
    poses: tuple[PoseEntry, ...]
    advice: str
    _plan: FollowUpPlan = field(repr=False, compare=False)
    _again: Mapping[str, Any] = field(repr=False, compare=False)

    def by_label(self) -> dict[str, Pose]:
        """Label -> x, y, z (mm), rx, ry, rz (rad): the platform in the base frame, in order."""
        return full_poses(labels_for(self._plan.poses.count), self._plan.poses)

    def save(self, file: File) -> None:
        """Write a poses file for measuring; raises BadInput if it would lie in a run's folder."""
        path = path_of(file)
        assert path is not None
        outside_runs(path, self.runs)
        path.write_text(_poses_file(self._plan, self, self._again), encoding="utf-8")


def design(
    runs: Runs,
    discriminate: tuple[str, str],
    n: int = 10,
    *,
    add: Sequence[str] = (),
    model: File | None = None,
    offer: Sequence[File] = (),
    candidates: int = FOLLOW_UP_FROM,
    seed: int = 1,
    watch: Callable[[str], None] | None = None,
) -> FollowUpReport:
    """Choose the poses, their order, load and temperature that tell effect A from effect B.

    Parameters
    ----------
    runs, add, model
        As for :func:`fit`: what is known by now.
    discriminate : (str, str)
        Two effects; one may be ``"nothing"``: is the other there at all?
    n : int
        How many poses.
    offer : sequence of paths, optional
        Effect files; what they hold may be named in ``discriminate``.
    candidates : int
        Reachable poses among which is chosen.
    seed : int
        Draws the candidates.
    watch : callable, optional
        Told, in words, each condition for which poses are chosen.

    Returns
    -------
    FollowUpReport

    Raises
    ------
    BadInput
        Naming the file and the place in it; for effects that nothing here can tell apart; and if
        the way between the poses would pass a limit.

    Examples
    --------
    >>> plan = pkmcal.design("run", ("tracker-scale", "nothing"), n=10)      # doctest: +SKIP
    >>> plan.right_then                                                      # doctest: +SKIP
    {'tracker-scale': 0.97}
    """
    at_least(1, n=n, candidates=candidates)
    first, second = discriminate
    if first == second:
        raise BadInput(f"{first} is named twice", remedy="Name two effects, or 'nothing'")
    names = names_of(runs)
    refit, begin = load_refitter(names, tuple(add), path_of(model), offer=paths_of(offer))
    machine = refit.rows.machine
    effects = [
        refit.effects.get(name) or effect_named(name, machine)
        for name in discriminate
        if name != NOTHING
    ]
    if not effects:
        raise BadInput("no effect is named", remedy="Name two effects, or one and 'nothing'")
    plan = design_follow_up(
        with_noise_of(refit.fit(begin), path_of(model)),
        effects,
        n,
        np.random.default_rng(seed),
        candidates=candidates,
        watch=watch,
    )
    if faults := check_path(machine, plan.poses.q, tolerance_margin(machine)):
        raise BadInput(
            f"the way to pose {faults[0].end} passes a limit ({faults[0].violation})",
            remedy="Choose among other candidates: --seed",
        )
    again = {
        "model": model,
        "add": tuple(add),
        "offer": tuple(offer),
        "candidates": candidates,
        "seed": seed,
    }
    said = follow_up_report(plan, discriminate, begin, names)
    way = np.concatenate([refit.rows.extension, machine.extension(plan.poses.q)], axis=1)
    hard = {effect.id: effect.hard_to_see(machine, way) for effect in effects}
    if plan.certainty < SUFFICIENT or plan.at:
        said["advice"] += "".join(f" {name}: {why}." for name, why in hard.items() if why)
    return FollowUpReport.of(said, _plan=plan, _again=again)


def follow_up_report(
    plan: FollowUpPlan, discriminate: tuple[str, str], model: tuple[str, ...], runs: tuple[str, ...]
) -> dict[str, Any]:
    """A plan as plain data (``pkm-follow-up/1``)."""
    names = plan.poses.machine.task.coordinates
    labels = labels_for(plan.poses.count)
    return {
        "format": "pkm-follow-up/1",
        "machine": plan.poses.machine.name,
        "discriminate": list(discriminate),
        "model": list(model),
        "runs": list(runs),
        "conditions": plan.conditions,
        "right_now": plan.before,
        "right_then": plan.after,
        "poses": [
            {"label": label, **dict(zip(names, task, strict=True)), "q": q}
            for label, task, q in zip(labels, plan.poses.task.T, plan.poses.q.T, strict=True)
        ],
        "advice": _advice(plan, discriminate),
    }


def _advice(plan: FollowUpPlan, discriminate: tuple[str, str]) -> str:
    worst, now = plan.certainty, min(plan.before.values())
    what = f"{discriminate[0]} from {discriminate[1]}"
    if now >= 0.95:
        where = " and ".join(f"{name} with {stands}" for name, stands in plan.at.items())
        of = f" ({where}; elsewhere it may be harder to see)" if where else ""
        return f"The runs there are already tell {what}{of}: nothing need be measured for that."
    if worst < SUFFICIENT:
        return (
            f"These poses would tell {what} with a probability of {worst:.0%} only: measure more "
            "(--n), or change what poses cannot: where the tracker stands, the load, the heat."
        )
    how = "".join(f", with {name} at {value:g}" for name, value in plan.conditions.items())
    return f"Measure these poses in this order{how}; then fit the old and the new run together."


def _poses_file(plan: FollowUpPlan, report: FollowUpReport, again: Mapping[str, Any]) -> str:
    """The text of the poses file, with the command that gives it again."""
    first, second = report.discriminate
    about: dict[str, Any] = {"discriminate": f"{first} {second}", "seed": again["seed"]}
    about |= {f"predicted_{name}": value for name, value in plan.after.items()}
    about |= {f"condition_{name}": value for name, value in plan.conditions.items()}
    command = f"pkmcal design {' '.join(report.runs)} --discriminate {first} {second}"
    if again["model"] is not None:
        command += f" --model {os.fspath(again['model'])}"
    command += "".join(f" --add {name}" for name in again["add"])
    command += "".join(f" --offer {os.fspath(file)}" for file in again["offer"])
    if again["candidates"] != FOLLOW_UP_FROM:
        command += f" --candidates {again['candidates']}"
    command += f" --n {plan.poses.count} --seed {again['seed']}"
    title = f"{plan.poses.count} poses that tell {first} from {second}"
    return render_pose_file(labels_for(plan.poses.count), plan.poses, title, about, command)
