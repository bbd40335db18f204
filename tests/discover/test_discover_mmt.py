"""The MMT's ladder: 80 stars, eight pointing terms, each found in its turn (data/README.md).

The discovery core gets residuals, a Jacobian and candidate columns; the noise is unknown.
"""

from pathlib import Path

import numpy as np
import pytest

from calib.discover.score import Candidate, Null, Problem, Reduced, price, score

DATA = Path(__file__).parents[1] / "data" / "real" / "mmt" / "k_and_e.dat"


def read():
    lines = DATA.read_text().splitlines()
    table = np.array([line.split() for line in lines if len(line.split()) == 4 and line[0] != "!"])
    table = table.astype(float)
    az, el = np.deg2rad(table[:, 0]), np.deg2rad(table[:, 1])
    off = (table[:, :2] - table[:, 2:] + 180.0) % 360.0 - 180.0
    return az, el, 3600.0 * np.concatenate([off[:, 0] * np.cos(el), off[:, 1]])


def terms(az, el):
    zero, one = np.zeros_like(az), np.ones_like(az)
    pairs = {
        "IA": (-np.cos(el), zero),
        "IE": (zero, one),
        "AN": (-np.sin(az) * np.sin(el), -np.cos(az)),
        "AW": (-np.cos(az) * np.sin(el), np.sin(az)),
        "CA": (-one, zero),
        "NPAE": (-np.sin(el), zero),
        "TF": (zero, -np.cos(el)),
        "TX": (zero, -1.0 / np.tan(el)),
        "HECE2": (zero, np.cos(2 * el)),
        "HESE2": (zero, np.sin(2 * el)),
        "HASA": (np.sin(az) * np.cos(el), zero),
        "HACA": (np.cos(az) * np.cos(el), zero),
        "HASA2": (np.sin(2 * az) * np.cos(el), zero),
        "HACA2": (np.cos(2 * az) * np.cos(el), zero),
        "HESA2": (zero, np.sin(2 * az)),
        "HECA2": (zero, np.cos(2 * az)),
        "HZSE2": (np.sin(2 * el), zero),
        "HZCE2": (np.cos(2 * el), zero),
    }
    return {name: np.concatenate(pair) for name, pair in pairs.items()}


def fitted(y, columns, names):
    """Residual at the optimum, as a problem of unknown noise."""
    jacobian = np.array([columns[name] for name in names])
    solution, *_ = np.linalg.lstsq(jacobian.T, y, rcond=None)
    residual = y - jacobian.T @ solution
    return Problem(residual, jacobian, np.zeros(len(names)), known_scale=False)


def ranking(problem, columns, names):
    """Candidates that are left, best first, with family-wise p and the share explained."""
    generator = np.random.default_rng(3)
    reduced = [
        Reduced(problem, Candidate(name, column[None, None]))
        for name, column in columns.items()
        if name not in names
    ]
    cost = price(problem, reduced, Null(problem, generator), ())
    scores = [score(problem, one, cost.tries[one.candidate.name]) for one in reduced]
    total = float(problem.residual @ problem.residual)
    best = sorted(scores, key=lambda one: one.log_p)
    return [(s.name, np.exp(s.log_p) * cost.family, s.drop / total) for s in best]


def sky_rms(problem):
    return float(np.sqrt(np.mean(problem.residual**2) * 2))


LADDER = [
    (["IA", "IE"], 10.51, {"AN", "AW"}, 0.67),
    (["IA", "IE", "AN", "AW"], 5.71, {"CA", "NPAE"}, 0.55),
    (["IA", "IE", "AN", "AW", "CA", "NPAE"], 3.83, {"TF"}, 0.87),
    (["IA", "IE", "AN", "AW", "CA", "NPAE", "TF"], 1.37, {"TX"}, 0.54),
]


@pytest.mark.parametrize(("names", "rms", "wanted", "share"), LADDER)
def test_discover_mmt_right_term_first_at_every_step(names, rms, wanted, share):
    az, el, y = read()
    columns = terms(az, el)
    problem = fitted(y, columns, names)
    assert sky_rms(problem) == pytest.approx(rms, abs=0.01)
    (name, p, explained), *_ = ranking(problem, columns, names)
    assert name in wanted
    assert p < 1e-6
    assert explained == pytest.approx(share, abs=0.02)


def test_discover_mmt_nothing_is_called_for_after_the_ladder():
    az, el, y = read()
    columns = terms(az, el)
    names = ["IA", "IE", "AN", "AW", "CA", "NPAE", "TF", "TX"]
    problem = fitted(y, columns, names)
    assert sky_rms(problem) == pytest.approx(0.93, abs=0.01)
    (_, p, explained), *_ = ranking(problem, columns, names)
    assert explained < 0.075
    assert p > 0.005


def test_discover_mmt_rival_of_tube_flexure_is_shown_beside_it():
    az, el, y = read()
    columns = terms(az, el)
    names = ["IA", "IE", "AN", "AW", "CA", "NPAE"]
    first, second, *_ = ranking(fitted(y, columns, names), columns, names)
    assert first[0] == "TF"
    assert second[0] == "HECE2"
    assert second[2] == pytest.approx(0.77, abs=0.02)
