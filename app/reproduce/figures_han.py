"""Figures 4 to 8, 10, 11 and 13 of Han et al., from our numbers."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.report.figures import AFTER, BEFORE, INK, PALE, new_figure
from app.reproduce.han import DEG, KINDS, Han
from calib.arrays import Array
from calib.mechanism.limits import within_limits
from calib.mechanism.solve import inverse


def han_figures(study: Han) -> Iterator[tuple[str, str, Figure]]:
    """Figures as (name, caption, figure)."""
    yield "han-4", "Figure 4: identified parameter errors", _identified(study)
    yield "han-5-6", "Figures 5 and 6: complete and non-complete error model", _models(study)
    yield "han-7", "Figure 7: condition number over position", _condition_position(study)
    yield "han-8", "Figure 8: condition number over orientation", _condition_turns(study)
    yield "han-10", "Figure 10: observability index", _observability(study)
    yield "han-11", "Figure 11: 256 random and 29 chosen poses", _chosen(study)
    yield "han-13", "Figure 13: errors of the 29 poses, simulated prototype", _prototype(study)


def _legend_above(axis: Axes) -> None:
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.1)


def _parameter_axis(axis: Axes) -> None:
    groups = ("L0", "P", "B", "L_B", "L_P")
    edges = np.cumsum([0, 6, 18, 18, 6, 6])
    axis.set_xticks((edges[:-1] + edges[1:]) / 2 - 0.5, groups)
    for edge in edges[1:-1]:
        axis.axvline(edge - 0.5, color=PALE, linewidth=0.8)
    axis.set_ylabel("error, mm")
    assert len(KINDS) * 6 == 54


def _errors(study: Han, values: Array) -> Array:
    found: Array = (values - study.machine.nominal)[study.figure_order]
    return found


def _identified(study: Han) -> Figure:
    figure, axes = new_figure(7.4, 6.4, rows=3)
    shown = (
        ("nine random poses, no noise", study.exact[0]),
        ("29 random poses with noise", study.random_29[0]),
        ("256 random poses with noise", study.random_256[0]),
    )
    where = np.arange(54)
    for axis, (label, trial) in zip(axes, shown, strict=True):
        axis.bar(where, _errors(study, study.truth), color=PALE, label="given")
        axis.plot(where, _errors(study, trial.fit.values), ".", color=AFTER, label="identified")
        axis.set_title(f"{label}: largest deviation {trial.deviation:.2g} mm", loc="left")
        _parameter_axis(axis)
    _legend_above(axes[0])
    return figure


def _models(study: Han) -> Figure:
    figure, (top, bottom) = new_figure(7.4, 4.8, rows=2)
    where = study.fresh.take(np.arange(9))
    for label, trial, colour in (
        ("complete error model", study.exact[0], AFTER),
        ("offset errors neglected", study.without_offsets, BEFORE),
    ):
        left = np.abs(study.left(study.truth, trial.fit.values, where))
        place = np.arange(1, 10) + (0.2 if colour == BEFORE else -0.2)
        top.bar(place, left[:3].max(axis=0), 0.4, color=colour, label=label)
        bottom.bar(place, np.degrees(left[3:]).max(axis=0) * 3600.0, 0.4, color=colour)
    for axis, label in ((top, "largest position error, mm"), (bottom, "orientation, arcsec")):
        axis.set_yscale("log")
        axis.set_xticks(range(1, 10))
        axis.set_ylabel(label)
    _legend_above(top)
    bottom.set_xlabel("pose")
    return figure


def _map(study: Han, axis: Axes, names: tuple[int, int], span: float, fixed: Array) -> object:
    line = np.linspace(-span, span, 25)
    u, v = np.meshgrid(line, line)
    poses = np.repeat(fixed[:, None], u.size, axis=1)
    poses[names[0]] += u.ravel()
    poses[names[1]] += v.ravel()
    value = study.condition(poses)
    value[~within_limits(study.machine, inverse(study.machine, poses))] = np.nan
    scale = 1.0 if names[0] < 3 else 1.0 / DEG
    shown = np.ma.masked_invalid(value.reshape(u.shape))
    axis.grid(visible=False)
    return axis.pcolormesh(u * scale, v * scale, shown, cmap="viridis", vmin=3.2, vmax=4.6)


def _condition_position(study: Han) -> Figure:
    figure, axes = new_figure(9.0, 2.6, columns=5)
    for axis, height in zip(axes, (220.0, 225.0, 230.0, 235.0, 240.0), strict=True):
        drawn = _map(study, axis, (0, 1), 25.0, np.array([0.0, 0.0, height, 0.0, 0.0, 0.0]))
        axis.set_title(f"z = {height:.0f} mm", loc="left")
        axis.set_xlabel("x, mm")
    axes[0].set_ylabel("y, mm")
    figure.colorbar(drawn, ax=axes, label="condition of J1, turns at 100 mm")  # type: ignore[arg-type]
    return figure


def _condition_turns(study: Han) -> Figure:
    figure, axes = new_figure(7.4, 2.9, columns=3)
    for axis, turn in zip(axes, (0.0, 10.0, 20.0), strict=True):
        drawn = _map(
            study, axis, (3, 4), 15.0 * DEG, np.array([0.0, 0.0, 220.0, 0.0, 0.0, turn * DEG])
        )
        axis.set_title(f"rz = {turn:.0f} deg", loc="left")
        axis.set_xlabel("rx, deg")
    axes[0].set_ylabel("ry, deg")
    figure.colorbar(drawn, ax=axes, label="condition of J1, turns at 100 mm")  # type: ignore[arg-type]
    return figure


def _observability(study: Han) -> Figure:
    figure, (axis,) = new_figure(7.4, 3.4)
    counts = np.arange(9, 45)
    for k, curve in enumerate(study.observability):
        axis.plot(counts, curve, color=AFTER, alpha=0.4 + 0.12 * k, label=f"selection {k + 1}")
    axis.set_yscale("log")
    axis.axvline(29, color=BEFORE, linestyle="--", linewidth=0.9)
    axis.set_xlabel("poses")
    axis.set_ylabel("observability index (whitened, 1/mm)")
    axis.legend(ncols=2)
    return figure


def _chosen(study: Han) -> Figure:
    figure, (axis,) = new_figure(7.4, 3.2)
    where = np.arange(54)
    axis.bar(where, _errors(study, study.truth), color=PALE, label="given")
    for trial, label, mark, colour in (
        (study.random_256[0], "256 random poses", ".", BEFORE),
        (study.optimal_29, "29 chosen poses", "x", AFTER),
    ):
        axis.plot(where, _errors(study, trial.fit.values), mark, color=colour, label=label)
    _parameter_axis(axis)
    _legend_above(axis)
    return figure


def _prototype(study: Han) -> Figure:
    figure, axes = new_figure(7.4, 5.4, rows=2, columns=2)
    truth = study.vector("table5", study.machine.nominal)
    poses = np.arange(1, 30)
    for row, values in enumerate((study.machine.nominal, study.prototype_values)):
        left = study.left(truth, values, study.chosen_29)
        for part, (label, scale) in enumerate(
            (("position, mm", 1.0), ("orientation, deg", 1 / DEG))
        ):
            axis = axes[2 * row + part]
            for k, colour in enumerate((INK, AFTER, BEFORE)):
                axis.plot(poses, scale * left[3 * part + k], color=colour, label="xyz"[k])
            axis.set_title(("before, " if row == 0 else "after, ") + label, loc="left")
    _legend_above(axes[0])
    for axis in axes[2:]:
        axis.set_xlabel("pose")
    return figure
