"""A mock station for scripts: a process of its own that ends with the script."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import tomli_w

from app.demo.station import mock_station as start


@contextmanager
def mock_station(
    machine: str = "hexapod",
    *,
    seed: int = 1,
    scale: float = 600.0,
    effects: Mapping[str, float] | None = None,
    folder: str | os.PathLike[str] | None = None,
) -> Iterator[Path]:
    """Start a mock machine with its tracker and three SMRs; it ends with the ``with`` block.

    Parameters
    ----------
    machine : str
        ``"hexapod"``, ``"tripod"`` or ``"ptm"``.
    seed : int
        Draws the true parameters, the room and the noise.
    scale : float
        Machine seconds in one second.
    effects : mapping, optional
        Hidden effects by parameter, mm, rad, K, N: ``{"backlash.leg3": 0.015}``.
    folder : path, optional
        Where the site file, the controller's memory and the log are; made for this occasion and
        removed afterwards if None. With the same folder the controller remembers.

    Yields
    ------
    Path
        The site file.

    Raises
    ------
    DeviceError
        If it does not start.

    Examples
    --------
    >>> with pkmcal.mock_station(seed=4) as site, pkmcal.Station(site) as station:
    ...     station.measure(pkmcal.choose_poses("hexapod", 20).by_label())   # doctest: +SKIP
    """
    with TemporaryDirectory(prefix="pkmcal-mock-") as made:
        home = Path(made if folder is None else folder)
        home.mkdir(parents=True, exist_ok=True)
        arguments: tuple[str, ...] = ()
        if effects:
            hidden = home / "hidden.toml"
            hidden.write_text(tomli_w.dumps({"hidden": dict(effects)}), encoding="utf-8")
            arguments = ("--hidden", str(hidden))
        with start(machine, seed, scale, home, arguments) as site:
            yield site
