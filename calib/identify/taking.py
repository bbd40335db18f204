"""How the readings of a fit were taken: in time, at which stop, by what, from how far."""

import math

import numpy as np

from calib.arrays import Array, BoolArray
from calib.model.state import Linearised
from calib.noise import Noise, Scatter, Taking
from calib.noise.scatter import ADDED, ADDED_ANGLE, RANGE
from calib.runs.sensed import kind_words
from calib.runs.sensing import POSE
from calib.runs.stack import Rows

UM, METRE = 1e-3, 1e3
"""A micrometre and a metre in mm."""
ARCSECOND = math.pi / 180.0 / 3600.0


def taken(linear: Linearised, kept: BoolArray) -> Taking:
    """How readings ``kept`` (N,) of a linearised model were taken."""
    rows = linear.situation.rows
    usual = np.array([axis.usual_error for axis in rows.machine.axes])
    columns = linear.situation.actuator_columns * rows.on_platform
    visit = np.where(rows.on_platform, rows.path.stop[rows.at], -1)
    motions = (usual[:, None, None] * columns)[:, :, kept]
    live = None if rows.sensed is None else rows.live[:, kept]
    scatter = scattered(linear, kept)
    return Taking(rows.run[kept], rows.time_s[kept], visit[kept], motions, live, scatter)


def scattered(linear: Linearised, kept: BoolArray) -> Scatter:
    """What the scatter of readings ``kept`` (N,) may hang on."""
    rows = linear.situation.rows
    point = linear.situation.point[:, kept]
    distance = np.sqrt(np.sum(point**2, axis=0))
    seen = (rows.optical & rows.placed)[kept] & (distance > 0.0)
    beam = np.einsum("ijn,jn->in", rows.whitener[:, :, kept], point)
    length = np.sqrt(np.sum(beam**2, axis=0))
    beam = np.where(seen, beam / np.where(length > 0.0, length, 1.0), 0.0)
    return Scatter(_groups(rows, kept), beam, _added(rows, kept, np.where(seen, distance, 0.0)))


def noise_covariance(linear: Linearised, noise: Noise, which: BoolArray) -> Array:
    """Covariance (3, 3, M) of readings' own noise in stated sigmas, the machine's errors apart."""
    if noise.scatter:
        return noise.scale**2 * scattered(linear, which).covariance(noise.scatter)
    each = noise.scale**2 * np.eye(3)[:, :, None]
    return np.asarray(np.broadcast_to(each, (3, 3, int(which.sum()))))


def noise_variances(linear: Linearised, noise: Noise, which: BoolArray) -> Array:
    """Variance (3, M) of each component by readings' own noise, mm^2 or rad^2."""
    root = linear.situation.rows.unwhitener[:, :, which]
    own = noise_covariance(linear, noise, which)
    return np.asarray(np.einsum("ijn,jkn,ikn->in", root, own, root))


def _groups(rows: Rows, kept: BoolArray) -> dict[str, BoolArray]:
    """Readings of a nest, of an instrument, of a run, of a kind: of those that there are two of."""
    labels: list[list[str]] = [[f"nest {name}" for name in rows.nest_name]]
    labels.append([f"instrument {name}" if name else "" for name in _instruments(rows)])
    labels.append([f"run {_name(rows, run)}" for run in rows.run])
    if rows.sensed is not None:
        own = rows.sensed
        kinds = zip(own.kind, own.turn, strict=True)
        labels.append([f"kind {kind_words(kind, turn)}" for kind, turn in kinds])
    found: dict[str, BoolArray] = {}
    for column in labels:
        names = [name for name in dict.fromkeys(column) if name]
        if len(names) > 1:
            told = np.array(column)
            found |= {name: (told == name)[kept] for name in names}
    return found


def _name(rows: Rows, run: int) -> str:
    """Folder of a run; its number where folders do not tell them apart."""
    folders = [one.source.replace("\\", "/").rpartition("/")[0] for one in rows.runs]
    return folders[run] if len(set(folders)) == len(folders) else str(run + 1)


def _instruments(rows: Rows) -> list[str]:
    """Who took each reading, where the run says it."""
    if rows.sensed is None:
        return [""] * rows.count
    found = []
    for run, line in zip(rows.run, rows.line, strict=True):
        own = rows.runs[run]
        at = int(np.searchsorted(own.line, line))
        found.append("" if own.sensing is None else own.sensing.instrument[at])
    return found


def _added(rows: Rows, kept: BoolArray, distance: Array) -> dict[str, Array]:
    """Covariance (3, 3, A) in stated sigmas of noise that is added to all readings of a unit."""
    whitener = rows.whitener[:, :, kept]
    square = np.einsum("ijn,kjn->ikn", whitener, whitener)
    if rows.sensed is None:
        angular = alone = np.zeros(distance.size, dtype=bool)
    else:
        angular = rows.sensed.angular[kept]
        alone = (rows.sensed.kind == POSE)[kept]  # its place and attitude share their noise
    found = {
        ADDED: UM**2 * square * ~(angular | alone),
        ADDED_ANGLE: ARCSECOND**2 * square * (angular & ~alone),
        RANGE: (UM / METRE * distance) ** 2 * square * ~(angular | alone),
    }
    return {name: shape for name, shape in found.items() if shape.any()}
