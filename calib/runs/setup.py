"""``run.toml`` of version 2: instruments, planes, nests that are not exactly known."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calib.runs.covariance import covariance_matrices
from calib.runs.sensing import Instrument, Plane, Setup
from calib.toml_table import TomlTable

Array = NDArray[np.float64]


def nests_of(table: TomlTable) -> tuple[dict[str, Array], dict[str, Array]]:
    """Centres (3,) and, where one is not exact, covariances (3, 3), by the nests' names.

    A nest is ``[x, y, z]`` or a table with ``at`` and one of ``sigma``, ``sigmas``, ``covariance``.
    """
    centres: dict[str, Array] = {}
    spreads: dict[str, Array] = {}
    for name in table:
        if not isinstance(table.raw(name), Mapping):
            centres[name] = np.array(table.numbers(name, 3, unit="mm"))
            continue
        one = table.table(name)
        one.only("at", "sigma", "sigmas", "covariance")
        centres[name] = np.array(one.numbers("at", 3, unit="mm"))
        spreads[name] = _spread(one)
    return centres, spreads


def _spread(table: TomlTable) -> Array:
    given = [key for key in ("sigma", "sigmas", "covariance") if table.has(key)]
    if len(given) != 1:
        raise table.wrong(
            f"a nest that is not exact has one of sigma, sigmas, covariance, not {len(given)}",
            "at",
            remedy="Write {at = [x, y, z], sigma = 0.5}, mm; or the plain [x, y, z] if it is exact",
        )
    if given == ["sigma"]:
        return np.eye(3) * table.number("sigma", unit="mm", above=0.0) ** 2
    if given == ["sigmas"]:
        sigmas = np.array(table.numbers("sigmas", 3, unit="mm"))
        if np.any(sigmas < 0) or not np.any(sigmas > 0):
            raise table.wrong(
                "sigmas are negative, or all zero", "sigmas", remedy="Zero is an exact direction"
            )
        return np.diag(sigmas**2)
    six = np.array(table.numbers("covariance", 6, unit="mm^2"))
    matrix = covariance_matrices(six[:, None])[:, :, 0]
    if float(np.linalg.eigvalsh(matrix)[0]) < -1e-9 * float(np.trace(matrix)):
        raise table.wrong(
            "the covariance of this nest is not positive",
            "covariance",
            remedy="Expected xx, yy, zz, xy, xz, yz in mm^2",
        )
    return matrix


def setup_of(top: TomlTable, spreads: Mapping[str, Array]) -> Setup:
    """Read ``[instruments.NAME]`` and ``[planes.NAME]``; raises BadInput."""
    instruments = top.named("instruments", required=False)
    return Setup(
        instruments={name: _instrument(instruments.table(name)) for name in instruments},
        planes=planes_of(top),
        nests=dict(spreads),
    )


def planes_of(top: TomlTable) -> dict[str, Plane]:
    """Read ``[planes.NAME]``; raises BadInput."""
    planes = top.named("planes", required=False)
    return {name: _plane(planes.table(name)) for name in planes}


def _instrument(table: TomlTable) -> Instrument:
    table.only("frame", "near", "axis", "zero_sigma", "scale_sigma", "model")
    return Instrument(
        frame=table.choice("frame", ("free", "base"), "free"),
        near=np.array(table.numbers("near", 6)) if table.has("near") else None,
        axis=_unit(table, "axis") if table.has("axis") else None,
        zero_sigma=table.optional_number("zero_sigma", above=0.0),
        scale_sigma=table.optional_number("scale_sigma", above=0.0),
        model=table.text("model", ""),
    )


def _plane(table: TomlTable) -> Plane:
    table.only("normal", "through", "sigma", "tilt_sigma")
    return Plane(
        normal=_unit(table, "normal"),
        through=np.array(table.numbers("through", 3, unit="mm")),
        sigma=table.number("sigma", 0.0, unit="mm", least=0.0),
        tilt_sigma=table.number("tilt_sigma", 0.0, unit="rad", least=0.0),
    )


def _unit(table: TomlTable, key: str) -> Array:
    vector = np.array(table.numbers(key, 3))
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 1e-3:
        raise table.wrong(
            f"{key} has the length {length:.6g}", key, remedy="Expected a direction of length 1"
        )
    return vector / length
