"""Choose where to measure, and see what accuracy to expect"""

import math
from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import progress, spread_options
from app.show.text_table import text_table
from calib.defaults import POSES_FROM
from calib.errors import BadInput


@click.command()
@click.argument("machine_name", metavar="[MACHINE]", default="")
@click.option("--machine", "machine_option", default="", help="Shipped machine or machine file.")
@click.option(
    "--n",
    "count",
    type=click.IntRange(1),
    default=29,
    show_default=True,
    help="How many poses to choose.",
)
@click.option(
    "--criterion",
    type=click.Choice(["I", "D"]),
    default="I",
    show_default=True,
    help="I: smallest predicted pose error; D: most information about the parameters.",
)
@click.option(
    "--for",
    "purpose",
    type=click.Choice(["accuracy", "discovery"]),
    default="accuracy",
    show_default=True,
    help="discovery: a third of the poses show what the machine may hide; what they will see.",
)
@click.option(
    "--priors/--no-priors", default=True, show_default=True, help="Use the tolerances as priors."
)
@click.option("--site", "site_file", type=click.Path(path_type=Path), help="Nests of a site file.")
@click.option("--heights", is_flag=True, help="Only heights over the base are read.")
@click.option(
    "--calipers", type=click.IntRange(0), default=0, metavar="N",
    help="Choose N pairs of marks, too, to be measured with calipers.",
)  # fmt: skip
@click.option(
    "--calipers-um", type=float, default=20.0, show_default=True,
    help="Standard uncertainty of such a distance, um.",
)  # fmt: skip
@click.option("--sigma-um", type=float, help="Standard uncertainty of a reading per axis, um.")
@click.option("--angle-mdeg", type=float, help="The same of an angle, where poses are read whole.")
@click.option(
    "--candidates",
    type=click.IntRange(1),
    default=POSES_FROM,
    show_default=True,
    help="Reachable candidates.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the candidates."
)
@click.option(
    "--margin-mm",
    type=float,
    help="Kept free at ends of strokes beyond what tolerances need.  [default: the site's, 0.1]",
)
@click.option(
    "--searches",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="Search with so many seeds, from --seed on, and keep the best.",
)
@spread_options
@click.option("--verification", is_flag=True, help="Write the verification grid instead.")
@click.option("--out", type=answer.WrittenFile(), help="Write a poses file for measure.")
@answer.json_option
def command(
    machine_name: str,
    machine_option: str,
    count: int,
    criterion: str,
    purpose: str,
    priors: bool,
    site_file: Path | None,
    heights: bool,
    calipers: int,
    calipers_um: float,
    sigma_um: float | None,
    angle_mdeg: float | None,
    candidates: int,
    seed: int,
    margin_mm: float | None,
    searches: int,
    workers: int | None,
    scheduler: str,
    verification: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Choose measurement poses among reachable ones and predict what accuracy they will give.

    The table tells what other numbers of poses would give, so that you can choose. The poses are
    ordered for a short path; the whole path has been checked against the limits. With --for
    discovery the last third of them is chosen, and to be visited in its order, to show effects
    that the model lacks; a table says which ones it will see, and which not. What a machine
    within its tolerances needs beyond the drawing is kept free of them, so that the same poses can
    be measured again once it has been calibrated.
    """
    from app.jobs.posing import choose_poses

    if machine_name and machine_option:
        raise BadInput("two machines are named", remedy="Give MACHINE or --machine, not both.")
    named = machine_name or machine_option or None
    if verification:
        _verification(named, site_file, out, as_json)
        return
    one = answer.working(f"choosing {count} of {candidates} reachable poses")
    with progress() if searches > 1 else one as watch:
        chosen = choose_poses(
            named,
            count,
            site=site_file,
            criterion="D" if criterion == "D" else "I",
            priors=priors,
            heights=heights,
            calipers=calipers,
            calipers_um=calipers_um,
            sigma_um=sigma_um,
            angle_mdeg=angle_mdeg,
            candidates=candidates,
            seed=seed,
            margin_mm=margin_mm,
            searches=searches,
            workers=workers,
            scheduler=scheduler,
            watch=watch,
            purpose="discovery" if purpose == "discovery" else "accuracy",
        )
    if out:
        chosen.save(out)
        answer.say(f"written to {out}")
    report = chosen.to_json()
    answer.show(report, as_json, _text(report))


def _text(report: dict[str, Any]) -> str:
    count, predicted = len(report["poses"]), report["predicted"]
    rows = [
        [str(one["n"]), _number(one["position_rms_um"]), _number(one["orientation_rms_mdeg"])]
        for one in report["by_count"]
        if one["n"] % 5 == 0
    ]
    table = text_table(["poses", "position um", "orientation mdeg"], rows)
    prior = "tolerances as priors" if report["tolerances_as_priors"] else "without priors"
    return (
        f"{report['machine']}: {count} of {report['candidates']} reachable poses, criterion "
        f"{report['criterion']}, {prior}\nread: {report['readings']}\n\n"
        f"predicted RMS at fresh poses: {_number(predicted['position_rms_um'])} um, "
        f"{_number(predicted['orientation_rms_mdeg'])} mdeg "
        f"({count} random poses: {_number(report['random_poses']['position_rms_um'])} um)\n"
        f"{_marks(report)}"
        f"path: {report['path_in_strokes']:.1f} strokes of the slowest actuator, within all "
        f"limits\n{_kept_free(report)}\n\n{_sights(report)}{table}"
    )


def _sights(report: dict[str, Any]) -> str:
    """What the plan will and will not see, the least first."""
    if not report["will_see"]:
        return ""
    rows = [
        [one["effect"], f"{one['power']:.2f}", f"{one['by_accuracy']:.2f}"]
        for one in report["will_see"]
    ]
    hard = "".join(f"{one['effect']}: {one['why']}\n" for one in report["will_see"] if one["why"])
    missing = "".join(f"{name}: not asked: {why}\n" for name, why in report["not_asked"].items())
    return (
        "An effect of size 1 moves the readings by as much as their noise (RMS). Probability that\n"
        "it is called for by these poses, and by as many that are chosen for accuracy alone:\n\n"
        f"{text_table(['effect', 'these', 'accuracy'], rows)}\n\n{hard}{missing}\n"
    )


def _marks(report: dict[str, Any]) -> str:
    """Pairs of marks, and what they add."""
    if not report["pairs"]:
        return ""
    with_them = report["with_pairs"]
    return (
        f"calipers between the marks {', '.join(report['pairs'])}: "
        f"{_number(with_them['position_rms_um'])} um, "
        f"{_number(with_them['orientation_rms_mdeg'])} mdeg\n"
    )


def _kept_free(report: dict[str, Any]) -> str:
    """What stays free at the ends of the actuators' ranges, the least and the most."""
    parts = []
    for unit, factor, shown in (("mm", 1.0, "mm"), ("rad", math.degrees(1.0), "deg")):
        kept = [factor * one["each_end"] for one in report["kept_free"] if one["unit"] == unit]
        if kept:
            least, most = f"{min(kept):.2f}", f"{max(kept):.2f}"
            parts.append(f"{least} {shown}" if least == most else f"{least} to {most} {shown}")
    return f"kept free at each end of every range: {', '.join(parts)}"


def _number(value: float | None) -> str:
    return "nan" if value is None else f"{value:.2f}"


def _verification(
    named: str | None, site_file: Path | None, out: Path | None, as_json: bool
) -> None:
    from app.jobs.verification_grid import verification_grid

    grid = verification_grid(named, site=site_file)
    if out:
        grid.save(out)
        answer.say(f"written to {out}")
    spans = [
        f"{name} {low:.3f} .. {high:.3f} {'mm' if name in 'xyz' else 'deg'}"
        for name, (low, high) in grid.box.items()
    ]
    text = (
        f"{grid.machine}: {len(grid.poses)} verification poses, all within reach, in "
        f"{grid.workspace_scale:.3f} of the workspace:\n" + "\n".join(spans)
    )
    answer.show(grid.to_json(), as_json, text)
