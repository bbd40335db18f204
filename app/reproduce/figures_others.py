"""Figures 3 and 7 of Feng et al., 4, 5, 7 and 8 of Zhang et al., from our numbers."""

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from app.report.figures import AFTER, BEFORE, INK, PALE, new_figure
from app.reproduce.feng import Feng, bars
from app.reproduce.zhang import Zhang
from calib.arrays import Array


def feng_figures(study: Feng) -> Iterator[tuple[str, str, Figure]]:
    """Figures as (name, caption, figure)."""
    yield "feng-3", "Figure 3: sensitivity of each error source, mean and spread", _sources(study)
    yield (
        "feng-7",
        "Figure 7: slider errors before and after calibration, simulated",
        _sliders(study),
    )


def zhang_figures(study: Zhang) -> Iterator[tuple[str, str, Figure]]:
    """Figures as (name, caption, figure)."""
    for k, name in enumerate(("position", "orientation")):
        yield (
            f"zhang-{4 + k}",
            f"Figure {4 + k}: sensitivity of the 83 errors, {name}, equation (20)",
            _sensitivity(study, k),
        )
    linear, exact = study.linear("D3", 1e-6, 0.0), study.exact("D3", 1e-6, 0.0)
    for k, name in enumerate(("position", "orientation")):
        yield (
            f"zhang-{7 + k}",
            f"Figure {7 + k}: linear model and exact closure at the zero pose, {name}",
            _pairs(linear[:, k], exact[:, k], "mm" if k == 0 else "deg"),
        )


def _sources(study: Feng) -> Figure:
    figure, axes = new_figure(7.6, 5.6, rows=2, columns=2)
    names, values = bars(study)
    lengths = [k for k, n in enumerate(names) if n.startswith(("de1", "de2", "dh"))]
    angles = [k for k in range(len(names)) if k not in lengths]
    panels = (
        ("attitude, mrad per mm", lengths, 0), ("attitude, rad per rad", angles, 0),
        ("position, mm per mm", lengths, 2), ("position, mm per mrad", angles, 2),
    )  # fmt: skip
    for axis, (title, which, column) in zip(axes, panels, strict=True):
        mean, spread = values[which, column], values[which, column + 1]
        axis.bar(range(len(which)), mean, yerr=spread, color=AFTER, ecolor=INK, capsize=2)
        axis.set_xticks(range(len(which)), [names[k] for k in which], rotation=60, fontsize=7)
        axis.set_title(title, loc="left")
    return figure


def _sliders(study: Feng) -> Figure:
    figure, axes = new_figure(7.4, 2.8, columns=3)
    for axis, (key, title) in zip(
        axes, (("before", "before"), ("zero", "zero calibration"), ("full", "full calibration")),
        strict=True,
    ):  # fmt: skip
        errors = study.campaign[key]
        axis.errorbar(
            (1, 2, 3), errors.mean(axis=1), errors.std(axis=1),
            fmt="o", color=BEFORE if key == "before" else AFTER, capsize=4,
        )  # fmt: skip
        axis.set_xticks((1, 2, 3))
        axis.set_xlim(0.5, 3.5)
        axis.set_title(title, loc="left")
        axis.set_xlabel("branch")
    axes[0].set_ylabel("slider error, mm")
    return figure


def _sensitivity(study: Zhang, column: int) -> Figure:
    figure, (axis,) = new_figure(7.6, 3.6)
    names = [p.name for p in study.machine.parameters]
    values = study.sensitivity[:, column]
    essential = set(study.numbers["sensitivity"]["names"])
    colours = [AFTER if n in essential else PALE for n in names]
    axis.bar(range(83), values, color=colours)
    edges = [k for k in range(1, 83) if names[k].split(".")[0] != names[k - 1].split(".")[0]]
    for edge in edges:
        axis.axvline(edge - 0.5, color=INK, linewidth=0.6)
    axis.set_yscale("log")
    axis.set_ylim(1e-3, 10.0)
    axis.set_xticks(range(83), [n.split(".")[1] for n in names], rotation=90, fontsize=4.5)
    unit = ("mm per mm or deg", "deg per mm or deg")[column]
    axis.set_title(f"{unit}; dark: called essential in the text; limbs 1 to 5", loc="left")
    return figure


def _pairs(linear: Array, exact: Array, unit: str) -> Figure:
    figure, (axis,) = new_figure(7.6, 3.0)
    where = np.arange(1, len(linear) + 1)
    axis.bar(where - 0.2, linear, 0.4, color=AFTER, label="linear model")
    axis.bar(where + 0.2, exact, 0.4, color=BEFORE, label="exact closure")
    axis.set_xticks(where)
    axis.tick_params(axis="x", labelsize=7)
    axis.set_xlabel("no. in table 1")
    axis.set_ylabel(unit)
    gap = np.max(np.abs(linear - exact))
    axis.set_title(f"largest difference {gap:.2g} {unit}; limb 3 released", loc="left")
    axis.legend()
    return figure
