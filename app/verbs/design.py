"""Plan the next measurements: those that tell two effects apart

The poses file that it writes is measured with pkmcal measure; then fit old and new run together.
"""

from pathlib import Path
from typing import Any

import click
import numpy as np

from app import answer
from app.analysis import load_refitter, model_options
from app.files.poses import render_pose_file
from app.files.runs import outside_runs
from calib.discover.design import CANDIDATES, FollowUpPlan, design_follow_up
from calib.effects import effect_named
from calib.errors import BadInput
from calib.poses.design import labels_for
from calib.poses.path import check_path

NOTHING = "nothing"
SUFFICIENT = 0.8


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@click.option(
    "--discriminate",
    nargs=2,
    required=True,
    metavar="A B",
    help="Two effects; B may be 'nothing': is A there at all?",
)
@click.option("--n", "count", default=10, show_default=True, type=click.IntRange(1, 60))
@click.option("--candidates", default=CANDIDATES, show_default=True, type=click.IntRange(20, 5000))
@click.option("--seed", default=1, show_default=True, help="Seed of the reachable candidates.")
@click.option("--out", type=click.Path(path_type=Path), help="Write a poses file for measure.")
@model_options
@answer.json_option
def command(
    runs: tuple[str, ...],
    discriminate: tuple[str, str],
    count: int,
    candidates: int,
    seed: int,
    out: Path | None,
    add: tuple[str, ...],
    model: Path | None,
    as_json: bool,
) -> None:
    """Choose the poses, their order, load and temperature that tell effect A from effect B.

    RUN... are the runs there are; the sizes of A and B are those that they show, or the usual
    ones where they show nothing. The answer says how likely the right one is recognised now, and
    with the follow-up too.
    """
    first, second = discriminate
    if first == second:
        raise BadInput(f"{first} is named twice", remedy="Name two effects, or 'nothing'")
    outside_runs(out, runs)
    refit, begin = load_refitter(runs, add, model)
    machine = refit.rows.machine
    effects = [effect_named(name, machine) for name in discriminate if name != NOTHING]
    if not effects:
        raise BadInput("no effect is named", remedy="Name two effects, or one and 'nothing'")
    plan = design_follow_up(
        refit.fit(begin),
        effects,
        count,
        np.random.default_rng(seed),
        candidates=candidates,
        watch=lambda condition: answer.say(f"choosing {count} poses, {condition} ..."),
    )
    if faults := check_path(machine, plan.poses.q):
        raise BadInput(
            f"the way to pose {faults[0].end} passes a limit ({faults[0].violation})",
            remedy="Choose among other candidates: --seed",
        )
    report = follow_up_report(plan, discriminate, begin, runs)
    if out is not None:
        given = [f"--model {model}"] * (model is not None) + [f"--add {name}" for name in add]
        given += [f"--candidates {candidates}"] * (candidates != CANDIDATES)
        out.write_text(_poses_file(plan, report, seed, given), encoding="utf-8")
        answer.say(f"written to {out}")
    answer.show(report, as_json, words(report))


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
        return f"The runs there are already tell {what}: nothing need be measured for that."
    if worst < SUFFICIENT:
        return (
            f"These poses would tell {what} with a probability of {worst:.0%} only: measure more "
            "(--n), or change what poses cannot: where the tracker stands, the load, the heat."
        )
    how = "".join(f", with {name} at {value:g}" for name, value in plan.conditions.items())
    return f"Measure these poses in this order{how}; then fit the old and the new run together."


def words(report: dict[str, Any]) -> str:
    """Say a plan to a person."""
    first, second = report["discriminate"]
    rows = [
        (name, f"{report['right_now'][name]:.0%}", f"{report['right_then'][name]:.0%}")
        for name in report["right_now"]
    ]
    coordinates = [key for key in report["poses"][0] if key not in ("label", "q")]
    poses = [
        (pose["label"], *(_coordinate(name, float(pose[name])) for name in coordinates))
        for pose in report["poses"]
    ]
    header = ("pose", *(name if name in "xyz" else f"{name} deg" for name in coordinates))
    return "\n".join(
        [
            f"telling {first} from {second}: probability of the right answer",
            answer.table(("if the truth is", "now", "with the follow-up"), rows),
            "",
            *(f"{name} must be {value:g}" for name, value in report["conditions"].items()),
            "in this order (the direction of approach is that of the way there):",
            answer.table(header, poses),
            "",
            report["advice"],
        ]
    )


def _coordinate(name: str, value: float) -> str:
    return f"{value:.2f}" if name in "xyz" else f"{np.rad2deg(value):.3f}"


def _poses_file(plan: FollowUpPlan, report: dict[str, Any], seed: int, given: list[str]) -> str:
    first, second = report["discriminate"]
    about: dict[str, Any] = {"discriminate": f"{first} {second}", "seed": seed}
    about |= {f"predicted_{name}": value for name, value in plan.after.items()}
    about |= {f"condition_{name}": value for name, value in plan.conditions.items()}
    command = f"pkmcal design {' '.join(report['runs'])} --discriminate {first} {second}"
    command += "".join(f" {option}" for option in given)
    command += f" --n {plan.poses.count} --seed {seed}"
    title = f"{plan.poses.count} poses that tell {first} from {second}"
    return render_pose_file(labels_for(plan.poses.count), plan.poses, title, about, command)
