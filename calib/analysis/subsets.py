"""What a calibration reaches that fits only some of the unknowns: sensitivity is not enough.

The unknowns delta ~ N(0, prior) are read through A with unit noise. A fit of the subset S by least
squares finds M y for S and leaves the others at nominal; the error of the pose at fresh poses
follows exactly, without simulation: e = (M A - I) delta + M noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from calib.analysis.identifiability import EXACT, exact_rank
from calib.analysis.observation import Observation
from calib.errors import BadInput
from calib.poses.information import Judge


@dataclass(frozen=True)
class SubsetResult:
    """What fitting ``count`` unknowns, ``rank`` of them independent, leaves at fresh poses.

    RMS of position (um) and orientation (mdeg), over machines drawn from the priors.
    """

    says: str
    count: int
    rank: int
    priors: bool
    position_um: float
    orientation_mdeg: float


def calibrated(
    observation: Observation, judge: Judge, chosen: Sequence[int], *, priors: bool, says: str
) -> SubsetResult:
    """Predict what fitting the unknowns ``chosen`` leaves.

    Without ``priors`` directions that cannot be seen at all stay at nominal (least squares of
    smallest norm), as a careful person's program would do.
    """
    A, p = observation.A, len(observation.names)
    held = list(chosen)
    part = A[:, held]
    M = np.zeros((p, len(A)))
    norms = np.linalg.norm(part, axis=0)
    norms = np.where(norms > 0.0, norms, 1.0)
    if held and priors:
        information = part.T @ part + np.diag(observation.prior[held])
        information += np.diag(np.where(observation.prior[held] > 0.0, 0.0, 1e-8))
        M[held] = np.linalg.solve(information, part.T)
    elif held:
        M[held] = np.linalg.pinv(part / norms, rcond=EXACT) / norms[:, None]
    left = M @ A - np.eye(p)
    # Frames have no prior: they are as wrong as they are, and a fit without them is no fit.
    left = left * np.where(observation.prior > 0.0, 1.0, 0.0)
    accuracy = judge.accuracy(left @ left.T + M @ M.T)
    rank = exact_rank(part / norms) if held else 0
    return SubsetResult(
        says, len(held), rank, priors, accuracy.position_um, accuracy.orientation_mdeg
    )


def matching(names: Sequence[str], patterns: Sequence[str]) -> list[int]:
    """Indices of the names that match any of the patterns (``*`` and ``?`` as in a shell).

    Raises
    ------
    BadInput
        If a pattern matches nothing.
    """
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise BadInput(
                f'no parameter matches "{pattern}"', remedy='Write for example "limb?.0dx1".'
            )
    return [k for k, name in enumerate(names) if any(fnmatchcase(name, p) for p in patterns)]


def most_sensitive(observation: Observation, judge: Judge, count: int) -> list[int]:
    """The ``count`` parameters whose priors move the platform most, by the judge's position.

    Orientation counts with the ratio of the two mean squares, so that both matter alike.
    """
    position, turn = np.diag(judge.position), np.diag(judge.orientation)
    geometry = slice(0, observation.geometry)
    balance = position[geometry].sum() / max(turn[geometry].sum(), 1e-300)
    weight = position[geometry] + balance * turn[geometry]
    return sorted(int(k) for k in np.argsort(-weight, kind="stable")[:count])


def compare_subsets(
    observation: Observation,
    judge: Judge,
    base: Sequence[str],
    named: Sequence[int] | None = None,
) -> tuple[SubsetResult, ...]:
    """Nothing, everything with priors, the base parameters, as many most sensitive ones, a choice.

    Unknowns of frames and nests are fitted in every case but the first.
    """
    geometry, p = observation.geometry, len(observation.names)
    others = list(range(geometry, p))
    index = {name: k for k, name in enumerate(observation.names)}
    independent = [k for k in (index[name] for name in base) if k < geometry]
    strongest = most_sensitive(observation, judge, len(independent))
    cases: list[tuple[str, list[int], bool]] = [
        ("nothing is calibrated", [], False),
        ("all parameters, tolerances as priors", list(range(geometry)), True),
        ("base parameters (independent), no priors", independent, False),
        (f"the {len(strongest)} most sensitive parameters, no priors", strongest, False),
    ]
    if named is not None:
        cases.append(
            (f"the {len(named)} parameters that were named, no priors", list(named), False)
        )
        cases.append(
            (f"the {len(named)} parameters that were named, with priors", list(named), True)
        )
    return tuple(
        calibrated(observation, judge, [*held, *others] if held else [], priors=priors, says=says)
        for says, held, priors in cases
    )
