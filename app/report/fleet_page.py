"""A fleet as a page: its machines, what is usual among them, and who is not like the others."""

from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np

from app.report.figures import new_figure
from app.report.page import Facts, Items, Page, Picture, Section, Table, Text
from calib.digits import Digits

BLUE, RED = "#1f6f8b", "#c8553d"


def fleet_page(report: Mapping[str, Any]) -> Page:
    """Set the answer of ``pkmcal fleet fit`` (``pkm-fleet/1``) as a page."""
    good = [one for one in report["machines"] if not one["failed"]]
    outliers = len({one["machine"] for one in report["outliers"]})
    now = datetime.now(UTC)
    return Page(
        title=f"Fleet of {len(report['machines'])} machines",
        number=f"{report['machine']}-{now:%Y%m%d}",
        issued=f"{now:%Y-%m-%d}",
        laboratory="",
        head=Facts(
            (
                ("Type", report["machine"]),
                ("Machines", f"{len(report['machines'])}, of which {len(good)} could be fitted"),
                ("Effects in the model", ", ".join(report["effects"]) or "none"),
                ("Not like the others", str(outliers) if outliers else "none"),
            )
        ),
        sections=(
            Section("Not like the others", _outliers(report)),
            Section("Machines", (_quality(good), _machines(report))),
            Section("What is usual", (_usual(report), _parameters(report))),
        ),
        footer=f"pkmcal {version('pkmcal')}",
    )


def outlier_lines(report: Mapping[str, Any]) -> tuple[str, ...]:
    """A sentence for each machine that is not like the others."""
    parameters = {one["name"]: k for k, one in enumerate(report["parameters"])}
    machines = {one["name"]: one for one in report["machines"]}
    lines = []
    for one in report["outliers"]:
        if one["what"] not in parameters:
            how = "its readings are explained worse than those of the others"
        else:
            k = parameters[one["what"]]
            usual, value = report["parameters"][k], machines[one["machine"]]["alone"][k]
            digits = Digits.of(usual["spread"], value, usual["mean"])
            how = (
                f"{one['what']} is {digits.text(value)} {usual['unit']}, usual is "
                f"{digits.text(usual['mean'])} +- {digits.text(usual['spread'])}"
            )
        sure = f"{one['ratio']:+.1f} sigma, p = {one['p_value']:.1g}"
        lines.append(f"{one['machine']}: {how} ({sure})")
    return tuple(lines)


def _outliers(report: Mapping[str, Any]) -> tuple[Text | Items, ...]:
    said = outlier_lines(report)
    remarks = tuple(Text(one) for one in report["remarks"])
    if not said:
        return (Text("No machine differs from the others by more than chance."), *remarks)
    about = Text(
        "Judged by the spread among the other machines and by what its own readings tell, over "
        "all machines and parameters together (family-wise p below 0.05), the surest first."
    )
    return (about, Items(said), *remarks)


def _machines(report: Mapping[str, Any]) -> Table:
    heads = (
        "machine",
        "readings",
        "left out",
        "RMS um",
        "perfect um",
        "held-out um",
        "chi2/dof",
        "",
    )
    rows = tuple(machine_row(one) for one in report["machines"])
    return Table(heads, rows, "Every machine, fitted alone.", (7,))


def machine_row(one: Mapping[str, Any]) -> tuple[str, ...]:
    """One machine in a table."""
    if one["failed"]:
        return (one["name"], *[""] * 6, "not fitted")
    numbers = ("rms_um", "noise_floor_um", "holdout_rms_um", "chi2_per_dof")
    said = ["-" if one[key] is None else f"{one[key]:.2f}" for key in numbers]
    mark = "not like the others" if one["outlier"] else ""
    return (one["name"], str(one["readings"]), str(one["excluded"]), *said, mark)


def _parameters(report: Mapping[str, Any]) -> Table:
    heads = ("parameter", "unit", "nominal", "usual", "spread", "tolerance", "of tolerance")
    rows = tuple(parameter_row(one) for one in report["parameters"])
    return Table(heads, rows, "Standard deviations; the tolerance as one, too.", (1,))


def parameter_row(one: Mapping[str, Any]) -> tuple[str, ...]:
    """One parameter over the fleet, in a table."""
    digits = Digits.of(one["spread"], one["mean"], one["nominal"])
    return (
        one["name"], one["unit"], digits.text(one["nominal"]), digits.text(one["mean"]),
        digits.text(one["spread"]), digits.text(one["tolerance"]),
        f"{100.0 * one['spread'] / one['tolerance']:.0f} %",
    )  # fmt: skip


def _quality(good: list[Mapping[str, Any]]) -> Picture:
    """RMS over what a perfect model would leave, machine by machine."""
    figure, (axes,) = new_figure(7.0, 2.4)
    ratio = [(one["rms_um"] or np.nan) / (one["noise_floor_um"] or np.nan) for one in good]
    colours = [RED if one["outlier"] else BLUE for one in good]
    axes.scatter(range(1, len(good) + 1), ratio, c=colours, s=14)
    axes.axhline(1.0, color="#777777", lw=0.8)
    axes.set_xlabel("machine, in the order of the table")
    axes.set_ylabel("RMS over perfect")
    return Picture.of(figure, "RMS of each machine over what a perfect model would leave.")


def _usual(report: Mapping[str, Any]) -> Picture:
    """Every machine's parameters, from nominal, in tolerances."""
    figure, (axes,) = new_figure(7.0, 2.8)
    nominal, tolerance, mean, spread = (
        np.array([one[key] for one in report["parameters"]])
        for key in ("nominal", "tolerance", "mean", "spread")
    )
    at = np.arange(nominal.size) + 1
    for one in report["machines"]:
        if not one["failed"]:
            off = (np.array(one["values"]) - nominal) / tolerance
            axes.plot(at, off, ".", ms=2.5, color=RED if one["outlier"] else "#9bb7c4")
    axes.errorbar(at, (mean - nominal) / tolerance, spread / tolerance, fmt="_", color=BLUE, lw=1.2)
    axes.axhline(0.0, color="#777777", lw=0.8)
    axes.set_xlabel("parameter, in the order of the table")
    axes.set_ylabel("from nominal, in tolerances")
    says = "Machines with the fleet's priors (points); usual value and spread (bars)."
    return Picture.of(figure, says)
