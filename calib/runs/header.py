"""``run.toml``: which machine, where the nests are, what the controller held, what it carried."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.errors import BadInput
from calib.runs.sensing import Setup
from calib.runs.setup import nests_of, setup_of
from calib.toml_table import Asked, TomlTable

FORMAT = "pkm-run/1"
OF_KINDS = "pkm-run/2"
"""Readings of several kinds, nests that are not exact; see docs/run-format-2.md."""
GRAVITY = (0.0, 0.0, -9.80665)


@dataclass(frozen=True)
class Load:
    """What the machine carries.

    ``gravity`` (3,) in m/s^2, base frame; centres of mass (3,) in mm, platform frame. The mass of
    the payload is a channel (``payload_kg``), since it may change from reading to reading.
    """

    gravity: NDArray[np.float64]
    platform_mass_kg: float
    platform_com: NDArray[np.float64]
    payload_com: NDArray[np.float64]


@dataclass(frozen=True)
class Header:
    """Everything that ``run.toml`` says; nests as (3,) in mm (platform or base frame)."""

    machine: str
    title: str = ""
    tracker: Mapping[str, Any] = field(default_factory=dict)
    platform_nests: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    base_nests: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    controller_serial: str = ""
    """Serial number of the controller, and so of the machine; empty where nobody wrote it down."""
    controller_parameters: Mapping[str, float] = field(default_factory=dict)
    compensation: Mapping[str, float] = field(default_factory=dict)
    """What the controller compensated meanwhile, by its own names; missing is zero."""
    controller_frame: Mapping[str, str] = field(default_factory=dict)
    """What the poses of a closed controller referred to, in its own words: pivot, system, order."""
    load: Load | None = None
    setup: Setup | None = None
    """What version 2 says more; None for a run of version 1."""


def parse_header(
    text: str, *, source: str = "run.toml", parameters: Collection[str] | None = None
) -> Header:
    """Read ``run.toml``.

    Parameters
    ----------
    text : str
        The file's text.
    source : str
        The file's name, for messages.
    parameters : collection of str, optional
        The machine's parameter names; with them, names under ``[controller.parameters]`` are
        checked. Leave it out while the machine is not known yet.

    Raises
    ------
    BadInput
        With file, line and remedy, for broken TOML or a value that is not what it should be.
    """
    return header_of(TomlTable.parse(text, source), parameters)


def header_of(top: TomlTable, parameters: Collection[str] | None = None) -> Header:
    """Read the tables of ``run.toml``, see :func:`parse_header`; other keys are left alone."""
    of_kinds = top.format(FORMAT, OF_KINDS) == OF_KINDS
    return contents_of(top, parameters, of_kinds=of_kinds)


def contents_of(
    top: TomlTable, parameters: Collection[str] | None = None, *, of_kinds: bool = False
) -> Header:
    """Read the same tables in a file of another format; raises BadInput with line and key.

    ``of_kinds``: with what version 2 says more.
    """
    machine = top.text("machine")
    if not machine.strip():
        raise top.wrong(
            "machine is empty", "machine", remedy='Write machine = "hexapod", or a machine file'
        )
    nests = top.table("nests", required=False)
    platform, base = nests.named("platform", required=False), nests.named("base", required=False)
    if not platform.names():
        raise top.wrong(
            "no nest is given under [nests.platform]",
            "nests",
            remedy="Write where each SMR nest is, mm in the platform frame: "
            '"3" = [0.0, 100.0, 0.0]',
        )
    for name in platform.names():
        if base.has(name):
            raise platform.wrong(
                f"nest {name!r} is both on the platform and on the base",
                name,
                remedy="Give every nest a name of its own",
            )
    controller = top.table("controller", required=False)
    if not of_kinds:
        platform_nests, base_nests, setup = _exact(platform), _exact(base), None
    else:
        platform_nests, of_platform = nests_of(platform)
        base_nests, of_base = nests_of(base)
        setup = setup_of(top, {**of_platform, **of_base})
    return Header(
        machine=machine,
        title=top.text("title", ""),
        tracker=_tracker(top),
        platform_nests=platform_nests,
        base_nests=base_nests,
        controller_serial=controller.text("serial", ""),
        controller_parameters=_controller_parameters(controller, parameters),
        compensation=controller.numbers_by_name("compensation"),
        controller_frame=texts_of(controller.named("frame", required=False)),
        load=load_of(top.table("load", required=False)) if top.has("load") else None,
        setup=setup,
    )


def _exact(nests: TomlTable) -> dict[str, NDArray[np.float64]]:
    return {name: np.array(nests.numbers(name, 3, unit="mm")) for name in nests}


def texts_of(table: TomlTable) -> dict[str, str]:
    """Every text of a table by its name; raises BadInput for what is none."""
    table.note("", Asked("text", "", False, None))
    return {name: table.text(name) for name in table}


def _tracker(top: TomlTable) -> dict[str, Any]:
    tracker = top.named("tracker", required=False)
    return {name: tracker.raw(name) for name in tracker}


def _controller_parameters(
    controller: TomlTable, known: Collection[str] | None
) -> dict[str, float]:
    found = controller.numbers_by_name("parameters")
    for name in found:
        if known is not None and name not in known:
            raise BadInput(
                f"the machine has no parameter {name!r}",
                place=controller.named("parameters").place_of_name(name),
                remedy=f"Expected one of {_some(known)}",
            )
    return found


def load_of(table: TomlTable) -> Load:
    """Read a table ``[load]``, of a run or of a site."""

    def vector(key: str, unit: str, default: tuple[float, ...]) -> NDArray[np.float64]:
        return np.array(table.numbers(key, 3, default, unit=unit))

    return Load(
        gravity=vector("gravity", "m/s^2", GRAVITY),
        platform_mass_kg=table.number("platform_mass_kg", 0.0, unit="kg", least=0.0),
        platform_com=vector("platform_com", "mm", (0.0, 0.0, 0.0)),
        payload_com=vector("payload_com", "mm", (0.0, 0.0, 0.0)),
    )


def _some(names: Collection[str], most: int = 4) -> str:
    listed = list(names)
    return ", ".join(listed[:most]) + (f" .. {listed[-1]}" if len(listed) > most else "")
