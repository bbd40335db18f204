"""Identification against scipy's least squares with 2-point differences on the same residual.

python -m bench identify
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from app.files.runs import read_run
from calib.identify import fit
from calib.identify.starting import begin as begin_fit
from calib.model import Model
from calib.runs.stack import Rows, stack

RUN = Path(__file__).parents[1] / "tests" / "data" / "runs" / "no-effect"


def first_poses(rows: Rows, count: int) -> Rows:
    """Readings of the first ``count`` poses, and the references."""
    keep = np.array([not name or int(name) <= count for name in rows.pose_name])
    return rows.take(keep)


def best_of(function: Callable[[], object], repeats: int) -> float:
    """Shortest wall time in s."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def by_scipy(rows: Rows) -> float:
    """chi2 + prior that scipy reaches, from the same start."""
    model = Model(rows)
    begin = begin_fit(model, model.usable)[0].state
    precision = 1.0 / model.prior

    def residual(step: np.ndarray) -> np.ndarray:
        state = model.moved(begin, step)
        predicted = model.predict(state)
        whitened = np.einsum("ijn,jn->in", rows.whitener, rows.position - predicted)
        return np.concatenate([whitened.ravel(), precision * model.deviation(state)])

    scale = np.where(np.isfinite(model.prior), model.prior, 1e-3)
    answer = least_squares(residual, np.zeros(model.prior.size), jac="2-point", x_scale=scale)
    return float(2.0 * answer.cost)


def main() -> None:
    loaded = read_run(RUN)
    rows = stack(loaded.machine, [loaded.run])
    for poses in (29, 60):
        some = first_poses(rows, poses)
        ours = best_of(lambda some=some: fit(Model(some)), 10)
        theirs = best_of(lambda some=some: by_scipy(some), 1)
        found = fit(Model(some))
        cost = found.chi2 + float(
            np.sum(found.prior_precision * found.model.deviation(found.linear.state) ** 2)
        )
        print(
            f"{poses} poses x 3 nests, {found.model.prior.size} unknowns: {1e3 * ours:.1f} ms, "
            f"scipy 2-point {theirs:.2f} s, ratio {theirs / ours:.0f}; "
            f"cost {cost:.6f} against {by_scipy(some):.6f}"
        )


if __name__ == "__main__":
    main()
