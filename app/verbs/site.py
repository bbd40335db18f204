"""Which devices a site file may name, and what each must be told"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.plain_data import printable
from drivers.kind import Kind, Setting, Takes

TAKES: dict[Takes, str] = {
    "parameters": "parameters and poses: it computes its own motion",
    "actuators": "actuator values: the host computes the motion and keeps the parameters",
    "poses": "poses: the host corrects them and keeps the parameters",
}
STORE = (
    Setting(
        "store", "text", "folder of the host's parameter sets, from the site file's folder; else "
        "one in this computer's own, by machine and serial number", "",
    ),
)  # fmt: skip


@click.group()
def command() -> None:
    """Help with site files: the kinds of devices there are, and whether a file is right."""


@command.command()
@click.argument("name", required=False)
@answer.json_option
def kinds(name: str | None, as_json: bool) -> None:
    """List the kinds of controllers and trackers, or the settings of one.

    Kinds of installed packages are listed like those that ship.
    """
    from app.jobs.device_kinds import kinds_called, site_kinds

    words = _words(kinds_called(name), in_full=name is not None)
    answer.show(site_kinds(name).to_json(), as_json, words)


@command.command()
@click.argument("site_file", type=click.Path(path_type=Path))
def check(site_file: Path) -> None:
    """Read a site file and say what it describes; nothing is connected."""
    from app.files.site import load_site

    site = load_site(site_file)
    said = (
        f"{site_file}: {site.machine.name}; controller {site.controller.kind} at "
        f"{site.controller.address}; {'gauge' if site.gauge else 'tracker'} "
        f"{site.measured_by.kind} at {site.measured_by.address}; "
        f"{len(site.platform_nests)} nests on the platform, {len(site.base_nests)} on the base"
    )
    click.echo(printable(said))


def _words(chosen: list[tuple[Any, str, Kind[Any]]], in_full: bool) -> str:
    lines: list[str] = []
    for role, name, kind in chosen:
        lines.append(f"{role:<11}{name:<12}{kind.says}")
        if role == "controller":
            lines.append(f"{'':<23}takes {TAKES[kind.takes]}")
        if in_full:
            settings = (*kind.settings, *(STORE if kind.takes != "parameters" else ()))
            lines += [f"  {one.name:<18}{_default(one):<16}{one.says}" for one in settings]
    return "\n".join(lines)


def _default(setting: Setting) -> str:
    if setting.required:
        return "needed"
    value = setting.default
    if value is None or value in ("", {}):
        return "-"
    return " ".join(value) if isinstance(value, list) else str(value)
