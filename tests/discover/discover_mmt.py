"""The MMT telescope as a linear problem: 80 stars, pointing terms of azimuth and elevation."""

from pathlib import Path

import numpy as np

from calib.evidence import Candidate, Columns, LinearProblem
from calib.unknown import Unknown

FILE = Path(__file__).parents[1] / "data" / "real" / "mmt" / "k_and_e.dat"
SIGMA = 0.65
"""Arc seconds per axis: what is left of the best model known (0.93 arc seconds on the sky)."""


def stars():
    """Azimuth, elevation (N,) in rad and residuals (2, N) in arc seconds."""
    rows = []
    for line in FILE.read_text().splitlines()[20:]:
        fields = line.split()
        if len(fields) == 4:
            rows.append([float(field) for field in fields])
    az, el, encoder_az, encoder_el = np.array(rows).T
    d_az = (az - encoder_az + 180.0) % 360.0 - 180.0
    sky = np.array([d_az * np.cos(np.radians(el)), el - encoder_el]) * 3600.0
    return np.radians(az), np.radians(el), sky


def terms():
    """Every pointing term's columns (2, N) per arc second."""
    az, el, _ = stars()
    sin, cos, none = np.sin, np.cos, np.zeros_like(az)
    table = {
        "IA": (-cos(el), none),
        "IE": (none, none + 1.0),
        "AN": (-sin(az) * sin(el), -cos(az)),
        "AW": (-cos(az) * sin(el), sin(az)),
        "CA": (none - 1.0, none),
        "NPAE": (-sin(el), none),
        "TF": (none, -cos(el)),
        "TX": (none, -1.0 / np.tan(el)),
        "HECE2": (none, cos(2 * el)),
        "HESE2": (none, sin(2 * el)),
        "HESA": (none, sin(az)),
        "HECA": (none, cos(az)),
        "HESA2": (none, sin(2 * az)),
        "HECA2": (none, cos(2 * az)),
        "HASA": (sin(az) * cos(el), none),
        "HACA": (cos(az) * cos(el), none),
        "HASA2": (sin(2 * az) * cos(el), none),
        "HACA2": (cos(2 * az) * cos(el), none),
    }
    return {name: np.array(columns) for name, columns in table.items()}


def problem(fitted):
    """Fit the named terms; the linear problem in sigmas, and the sky RMS in arc seconds."""
    _, _, sky = stars()
    jacobian = np.array([terms()[name].reshape(-1) for name in fitted]) / SIGMA
    data = sky.reshape(-1) / SIGMA
    values = np.linalg.lstsq(jacobian.T, data, rcond=None)[0]
    residual = data - jacobian.T @ values
    rms = SIGMA * np.sqrt(2.0 * np.mean(residual**2))
    return LinearProblem(residual, jacobian, np.zeros(len(fitted))), rms


def candidates(fitted):
    """Every term that is not fitted; sizes of ten arc seconds."""
    return [
        Candidate(
            name, (Unknown(name, "arcsec", 10.0),), Columns.of(columns.reshape(1, 1, -1) / SIGMA)
        )
        for name, columns in terms().items()
        if name not in fitted
    ]
