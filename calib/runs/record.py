"""A run as arrays: one column a row of ``points.csv``, in the order in which it was taken."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.runs.header import Header
from calib.runs.sensing import Sensing

Array = NDArray[np.float64]

FOLDS = 5
FOLD_SEED = 20_200_811  # fixed for ever: a hold-out that changes between two fits is none


@dataclass(frozen=True)
class Run:
    """One measuring campaign: N rows, moves without a reading among them.

    Attributes
    ----------
    header : Header
        What ``run.toml`` says.
    source : str
        Name of the points file, for messages.
    line : array, shape (N,)
        Line in ``points.csv`` (header = 1).
    time_s : array, shape (N,)
        Start of the dwell, s from the start of the run.
    pose, nest : tuple of str, length N
        Labels; an empty nest is a move without a reading, an empty pose a reference reading.
    q : array, shape (n, N)
        Commanded actuator coordinates.
    measured : array of bool, shape (N,)
        Which rows hold a reading.
    position : array, shape (3, N)
        SMR centre, tracker frame, mm; nan where nothing was read.
    covariance : array, shape (3, 3, N)
        Of that position, mm^2; nan where nothing was read.
    channels : mapping of str to array, shape (N,)
        Every other numeric column, ``delay_s`` and ``cycle`` among them; nan where empty.
    left_aside : mapping of str to str
        Columns that are no channel because they hold text, with the reason.
    sensing : Sensing, optional
        What each row measures, in a run of version 2: ``position`` then holds the components that
        were read (zero where none was) and ``covariance`` theirs. None: every reading is a point.
    """

    header: Header
    source: str
    line: NDArray[np.int64]
    time_s: Array
    pose: tuple[str, ...]
    nest: tuple[str, ...]
    q: Array
    measured: NDArray[np.bool_]
    position: Array
    covariance: Array
    channels: Mapping[str, Array]
    left_aside: Mapping[str, str]
    sensing: Sensing | None = None

    @property
    def readings(self) -> int:
        """Number of rows that hold a reading."""
        return int(self.measured.sum())


def holdout_folds(run: Run) -> NDArray[np.int64]:
    """Fold (0..4) of every row, whole pose labels together; -1 for references and moves.

    Seeded by a constant, so the hold-out of a run never depends on the model or on what was
    masked. Readings on the platform without a label are grouped by their commanded q.
    """
    labels = [_label(run, row) for row in range(len(run.nest))]
    unique = list(dict.fromkeys(label for label in labels if label))
    order = np.random.default_rng(FOLD_SEED).permutation(len(unique))
    fold = {label: int(place) % FOLDS for label, place in zip(unique, order, strict=True)}
    return np.array([fold.get(label, -1) for label in labels], dtype=np.int64)


def _within(run: Run, row: int) -> bool:
    """Whether a row holds a distance between two nests of the platform, wherever it stood."""
    own = run.sensing
    return bool(own and own.second[row] in run.header.platform_nests and own.ends[0, row] < 0)


def _label(run: Run, row: int) -> str:
    nests = run.header.platform_nests
    if run.nest[row] not in nests or _within(run, row):
        return ""
    return run.pose[row] or "q " + " ".join(f"{value:.4f}" for value in run.q[:, row])
