"""The Hangprinter, a four-line robot: 44 poses, of which 9 are known (tests/data/real/README.md).

Unknown are four anchors, spool radii, and where the machine stood at the other 35 poses. Rows are
line lengths in the order pose, line (A B C D).
"""

import json
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from calib.evidence import Candidate, Columns, LinearProblem, fill_missing
from calib.unknown import Unknown

FILE = Path(__file__).parents[1] / "data" / "real" / "hangprinter" / "hp4_force_series2.json"
SIGMA = 1.03
"""mm: residual standard deviation of the best model known."""
ADVANTAGE = np.array([2.0, 2.0, 2.0, 4.0])
PER_MM = 255 / 20 * ADVANTAGE * 360 / (2 * np.pi)
"""Degrees of the motor per mm of line at a spool radius of 1 mm."""
ANCHORS = np.array([[16.8, -1585, -113], [1290, 1229, -157], [-1410, 743, -152], [21.8, 0, 2344]])


class Hangprinter:
    """The machine with a linear spool (``radii``) and with build-up of line (``buildup``)."""

    def __init__(self):
        data = json.loads(FILE.read_text())
        self.motor = np.array(data["motor_pos_samp"])
        self.known = np.array(data["xyz_of_samp"])
        self.force = np.array(data["force_samp"])

    def wound(self, radii, buildup):
        """Line length change (44, 4), mm."""
        if buildup == 0.0:
            return self.motor * radii / PER_MM
        c1 = -ADVANTAGE * buildup
        return ((self.motor * c1 / (2.0 * PER_MM) + radii) ** 2 - radii**2) / c1

    def lines(self, x, radii, buildup):
        """Anchors (4, 3) and lengths (44, 4) of the lines for anchors, (radii, Q,) positions."""
        anchors = x[:12].reshape(4, 3)
        moved = x[12 + 4 * radii + buildup :].reshape(-1, 3)
        places = np.concatenate([self.known, moved])
        return anchors, np.linalg.norm(anchors[None] - places[:, None], axis=2)

    def residual(self, x, radii, buildup):
        """Measured minus predicted line length change, mm."""
        anchors, lengths = self.lines(x, radii, buildup)
        spool = x[12:16] if radii else np.full(4, 75.0)
        wound = self.wound(spool, x[16] if buildup else 0.0)
        return (wound - lengths + np.linalg.norm(anchors, axis=1)).reshape(-1)

    def start(self, radii, buildup):
        """Nominal machine; positions that fit the lines of each pose best."""
        lengths = self.wound(np.full(4, 75.0), 0.07) + np.linalg.norm(ANCHORS, axis=1)
        places = []
        for line in lengths[9:]:
            tries = [
                least_squares(
                    lambda p, line=line: np.linalg.norm(ANCHORS - p, axis=1) - line, guess
                )
                for guess in ([0.0, 0.0, 300.0], [0.0, 0.0, 1000.0])
            ]
            places.append(min(tries, key=lambda found: found.cost).x)
        spool = [75.0] * 4 if radii else []
        return np.concatenate([ANCHORS.ravel(), spool, [0.07] * buildup, np.ravel(places)])

    def fit(self, radii=True, buildup=False):
        """Optimum, residual standard deviation in mm, and BIC."""
        found = least_squares(
            self.residual, self.start(radii, buildup), args=(radii, buildup), x_scale="jac"
        )
        rows, unknowns, squares = found.fun.size, found.x.size, 2.0 * found.cost
        bic = rows * np.log(squares) + unknowns * np.log(rows)
        return found, np.sqrt(squares / (rows - unknowns)), bic

    def problem(self, found):
        """The fit as a linear problem in sigmas: the derivative of the prediction is minus J."""
        jacobian = -found.jac.T / SIGMA
        return LinearProblem(found.fun / SIGMA, jacobian, np.zeros(found.x.size))

    def candidates(self, problem, found, radii, buildup):
        """Build-up (unless fitted), line flex where the force was read, eccentric spools."""
        _, lengths = self.lines(found.x, radii, buildup)
        spool, eps = found.x[12:16], 1e-4
        grown = (self.wound(spool, eps) - self.wound(spool, -eps)) / (2.0 * eps)
        strained = np.zeros((44, 4))
        strained[:41] = self.force * lengths[:41]
        missing = np.repeat(np.arange(44) >= 41, 4)
        turn = np.deg2rad(self.motor * 20 / 255)
        waves = [shape(turn) * unit for unit in np.eye(4) for shape in (np.sin, np.cos)]
        columns = {
            "buildup": ([-grown], 0.1, "mm"),
            "line-flex": ([strained], 1e-5, "1/N"),
            "eccentric-spool": (waves, 1.0, "mm"),
        }
        if buildup:
            del columns["buildup"]
        answer = []
        for name, (shapes, size, unit) in columns.items():
            whitened = np.reshape(shapes, (len(shapes), -1)) / SIGMA
            if name == "line-flex":
                whitened = fill_missing(problem, whitened, missing)
            terms = tuple(Unknown(f"{name}.{k}", unit, size) for k in range(len(shapes)))
            answer.append(Candidate(name, terms, Columns.of(whitened[None])))
        return answer
