"""The corrected parameters of a model in a controller's own words, by a template."""

import json
import math
import re
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import tomli_w
from jinja2.sandbox import SandboxedEnvironment

from app.defaults import PLAIN, TEMPLATES
from app.files.fits import SavedFit, read_fit
from app.files.text import read_text
from app.hosted.parameters import effect_of
from app.jobs.chosen_runs import File
from app.jobs.corrector import machine_of
from app.jobs.urdf import urdf_of
from app.templating import compiled
from calib.command.identified import commandable
from calib.effects.struts import struts_of
from calib.errors import BadInput
from calib.mechanism.description import Machine
from drivers.errors import DeviceError
from drivers.kind import Strut
from drivers.linuxcnc.places import Places

FORMAT = "pkm-export/1"
LONGEST_TEMPLATE = 100_000


@dataclass(frozen=True)
class Number:
    """One number to be written; ``group`` and ``what`` are its name before and after the point."""

    name: str
    value: float
    sigma: float
    unit: str
    group: str
    what: str


@dataclass(frozen=True)
class Corrected:
    """What a model says a controller should hold.

    ``parameters`` are those of the machine file in its order, ``effects`` those of the machine's
    effects, whatever of them a controller can take; ``left_out`` are those of the measurement.
    """

    machine: Machine
    source: str
    parameters: tuple[Number, ...]
    effects: tuple[Number, ...]
    left_out: tuple[str, ...]
    controller: Mapping[str, float] = field(default_factory=dict)
    """The controller's own parameters: its coordinates refer to them."""

    @property
    def values(self) -> dict[str, float]:
        """Every number by its name."""
        return {one.name: one.value for one in (*self.parameters, *self.effects)}


def corrected(model: Path, machine: str | None = None) -> Corrected:
    """Read a model file, and the machine that it names.

    Raises
    ------
    BadInput
        For a file without values, or of another machine.
    """
    fit = read_fit(model)
    described = machine_of(model, fit, machine)
    absent = [p.name for p in described.parameters if p.name not in fit.estimates]
    if absent:
        raise BadInput(
            f"{len(absent)} parameters are not in the fit, the first is {absent[0]}",
            place=str(model),
            remedy="Fit all parameters together: they are correlated",
        )
    own = tuple(_number(fit, p.name, 0.0) for p in described.parameters)
    effects: list[Number] = []
    left_out = []
    used = fit.compensation or {}
    for identifier in fit.effects:
        if not commandable(effect_of(identifier, described, fit.own)):
            left_out.append(identifier)
            continue
        names = [name for name in fit.estimates if name.startswith(f"{identifier}.")]
        effects += [_number(fit, name, used.get(name, 0.0)) for name in names]
    return Corrected(described, str(model), own, tuple(effects), tuple(left_out), fit.controller)


def _number(fit: SavedFit, name: str, beside: float) -> Number:
    found = fit.estimates[name]
    group, _, what = name.partition(".")
    return Number(name, found.value + beside, found.sigma, found.unit, group, what)


def export(model: File, form: str, *, machine: str | None = None) -> str:
    """Write the corrected parameters of a model in a controller's own words.

    Parameters
    ----------
    model : path
        A model file.
    form : str
        ``json``, ``toml``, ``urdf``, a shipped template (``csv``, ``gcode-delta``, ``hal``,
        ``p-variables``), or the path of one's own.
    machine : str, optional
        Machine file, where it is not the one that the model names.

    Returns
    -------
    str
        The text.

    Raises
    ------
    BadInput
        For a model that does not suit, or a template with a fault; with its line.

    Examples
    --------
    >>> print(pkmcal.export("model.toml", "hal"))                            # doctest: +SKIP
    """
    found = corrected(Path(model), machine)
    if form == "urdf":
        return urdf_of(
            found.machine,
            {one.name: one.value for one in found.parameters},
            found.controller,
            _says(found),
        )
    if form in PLAIN:
        table = {
            "format": FORMAT,
            "machine": found.machine.name,
            "model": found.source,
            "parameters": {one.name: one.value for one in found.parameters},
            "effects": {one.name: one.value for one in found.effects},
            "left_out": list(found.left_out),
        }
        return json.dumps(table, indent=1) + "\n" if form == "json" else tomli_w.dumps(table)
    if form in TEMPLATES:
        source = files("app.templates").joinpath(f"export-{form}.j2").read_text(encoding="utf-8")
        return rendered(source, found, form)
    path = Path(form)
    if path.suffix != ".j2":
        raise BadInput(
            f'there is no form "{form}"',
            place="--as",
            remedy=f"Write one of {', '.join((*PLAIN, *TEMPLATES))}, or a template's path (.j2)",
        )
    return rendered(read_text(path), found, form)


def _says(found: Corrected) -> str:
    """What stands at the head of a URDF: where it is from, and what it does not hold."""
    lacks = [*dict.fromkeys(one.group for one in found.effects), *found.left_out]
    beyond = f" Not in it, as URDF is geometry alone: {', '.join(lacks)}." if lacks else ""
    return (
        f"{found.machine.name} as calibrated, from {found.source}. Lengths in m, angles in rad. "
        f"Efforts and velocities are not known here and stand as 0.{beyond}"
    )


def rendered(template: str, found: Corrected, place: str) -> str:
    """Fill in a template: sandboxed, and what is not defined is a fault.

    Raises
    ------
    BadInput
        With the template's line.
    """
    if len(template) > LONGEST_TEMPLATE:
        raise BadInput(
            f"the template has {len(template)} signs",
            place=place,
            remedy=f"At most {LONGEST_TEMPLATE} are taken",
        )
    environment = SandboxedEnvironment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    environment.globals["refuse"] = _refuse
    try:
        return compiled(environment, template).render(_told(found))
    except jinja2.TemplateSyntaxError as error:
        raise _fault(str(error.message), place, error.lineno) from error
    except _Refusal as error:
        raise BadInput(
            str(error), place=place, remedy="Export as json, or with a template of your own"
        ) from error
    except (DeviceError, BadInput) as error:
        raise BadInput(error.what, place=place, remedy=error.remedy) from error
    except (jinja2.TemplateError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise _fault(f"{type(error).__name__}: {error}", place, _line_of(error)) from error
    except (AttributeError, RecursionError, MemoryError, SyntaxError) as error:
        raise _fault(f"{type(error).__name__}: {error}", place, _line_of(error)) from error


class _Refusal(Exception):
    """A template does not suit the machine."""


def _refuse(why: str) -> str:
    raise _Refusal(why)


def _told(found: Corrected) -> dict[str, Any]:
    """What a template knows."""
    return {
        "machine": found.machine.name,
        "source": found.source,
        "parameters": found.parameters,
        "effects": found.effects,
        "left_out": found.left_out,
        "value": found.values,
        "nominal": {p.name: p.nominal for p in found.machine.parameters},
        "degrees": math.degrees,
        "groups": tuple(dict.fromkeys(one.group for one in found.parameters)),
        "pins": lambda: _pins(found),
    }


def _pins(found: Corrected) -> Mapping[str, float]:
    """Pins of LinuxCNC's genhexkins; raises DeviceError for a machine that it cannot hold."""
    struts = tuple(Strut(**vars(strut)) for strut in struts_of(found.machine))
    places = Places.of([one.name for one in found.parameters], struts)
    values = {**dict.fromkeys(places.effects, 0.0), **found.values}
    pins = places.to_pins(values, dict.fromkeys(places.pins, 0.0))
    return {name: value for name, value in pins.items() if not re.search(r"\.home$", name)}


def _line_of(error: BaseException) -> int:
    """Line of the template in which an error arose; 0 if it is not known."""
    lines = [
        frame.lineno or 0
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == "<template>"
    ]
    return lines[-1] if lines else 0


def _fault(what: str, place: str, line: int | None) -> BadInput:
    where = f"{place}, line {line}" if line else place
    return BadInput(what, place=where, remedy="docs/export.md says what a template knows")
