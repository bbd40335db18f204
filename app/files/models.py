"""Writing model files, and the effects that a model file and the options of a verb ask for.

What one session found is what ``fit``, ``apply`` and the next run begin with. A run itself is
never written to.
"""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import tomli_w

from app.files.controller_frames import frames_apart
from app.files.fits import MODEL_FORMAT, read_fit, region_table
from app.files.machines import shipped_machines
from app.files.noises import noise_tables
from app.files.staircase import Way, way_tables
from app.files.text import read_text
from app.surely import write_surely
from calib.command import Region
from calib.effects import Effect, effect_named, is_shipped
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.formulas.formula_effect import OperatorEffect
from calib.identify import Fit, fit_report
from calib.mechanism.description import Machine
from calib.runs.header import Load
from calib.toml_place import line_of


def compensation_of(fit: Fit) -> dict[str, float]:
    """What the controller compensated while the runs were taken, by its names; missing is zero.

    What a fit finds is what was left *beside* that.

    Raises
    ------
    BadInput
        If it was not the same in all runs.
    """
    held = [dict(run.header.compensation) for run in fit.model.rows.runs]
    if any(other != held[0] for other in held[1:]):
        raise BadInput(
            "the controller's compensation values were not the same in all runs",
            place=fit.model.rows.runs[0].source,
            remedy="Fit runs that were taken with the same values, or leave --save out",
        )
    return held[0]


def controller_frame(fit: Fit) -> dict[str, str]:
    """What a closed controller's poses referred to while the runs were taken; empty if untold.

    Raises
    ------
    BadInput
        If it was not the same in all runs: their poses are not of one kind.
    """
    told = [run for run in fit.model.rows.runs if run.header.controller_frame]
    for other in told[1:]:
        if apart := frames_apart(told[0].header.controller_frame, other.header.controller_frame):
            raise BadInput(
                f"the poses of the runs do not refer to the same: {apart[0]}",
                place=f"{told[0].source} and {other.source}",
                remedy="Fit runs that were taken with the same pivot and coordinate system, or "
                "leave --save out",
            )
    return dict(told[0].header.controller_frame) if told else {}


def controller_serial(fit: Fit) -> str:
    """The controller on which all runs were taken; empty if unknown, or not the same in all."""
    serials = {run.header.controller_serial for run in fit.model.rows.runs}
    return serials.pop() if len(serials) == 1 else ""


def write_model(path: Path, fit: Fit, way: Way = Way()) -> None:  # noqa: B008 - frozen
    """Write what a fit found, correlations included, and the way on which it was found."""
    report = fit_report(fit)
    sigma = fit.sigmas
    correlation = fit.covariance / (sigma[:, None] * sigma)
    last = fit.model.rows.runs[-1].header
    table: dict[str, Any] = {
        "format": MODEL_FORMAT,
        "machine": fit.model.machine.name,
        "machine_file": _machine_file(fit.model.machine, path),
        "controller_serial": controller_serial(fit),
        "runs": [run.source for run in fit.model.rows.runs],
        "effects": report["effects"],
        "compensation": compensation_of(fit),
        "controller_frame": controller_frame(fit),
        "own_effects": {
            effect.id: effect.text
            for effect in fit.model.effects
            if isinstance(effect, OperatorEffect)
        },
        "quality": {
            key: value
            for key, value in report.items()
            if isinstance(value, int | float) and value is not None
        },
        "parameters": [
            {key: value for key, value in entry.items() if value is not None}
            for entry in report["parameters"]
        ],
        "masked": report["bad_readings"],
        **way_tables(way),
        "controller": dict(last.controller_parameters),
        **({} if last.load is None else {"load": _load_table(last.load)}),
        "measured": region_table(Region.of_fit(fit)),
        **noise_tables(fit),
        "correlations": {
            name: [round(float(value), 6) for value in row[: index + 1]]
            for index, (name, row) in enumerate(zip(fit.model.names, correlation, strict=True))
        },
    }
    write_surely(path, tomli_w.dumps(table))


def _machine_file(machine: Machine, model: Path) -> str:
    """Where a lab's own machine file is, from the folder of the model file; empty if shipped."""
    source = Path(machine.source)
    shipped = machine.name in shipped_machines() and machine.source == f"{machine.name}.toml"
    if shipped or not source.is_file():
        return ""
    try:
        return Path(os.path.relpath(source, model.parent)).as_posix()
    except ValueError:  # on another drive of Windows
        return str(source.resolve())


def _load_table(load: Load) -> dict[str, Any]:
    return {
        "gravity": [float(v) for v in load.gravity],
        "platform_mass_kg": float(load.platform_mass_kg),
        "platform_com": [float(v) for v in load.platform_com],
        "payload_com": [float(v) for v in load.payload_com],
    }


def read_own_effect(path: Path) -> OperatorEffect:
    """Read an operator's effect file; raises BadInput with file, line and column of a fault."""
    text = read_text(path)
    effect = effect_from_text(text, str(path))
    if is_shipped(effect.id):
        raise BadInput(
            f"the id {effect.id!r} is that of an effect of the program",
            place=f"{path}, line {line_of(text, 'effect', 'id')}, id",
            remedy="Give the effect an id of its own",
        )
    return effect


def offered_effects(files: Iterable[Path], chosen: Iterable[Effect] = ()) -> list[Effect]:
    """A lab's own effects that stand beside the catalogue as candidates, each read from its file.

    One that is in the model already (``chosen``) is not offered again. Raises BadInput with file,
    line and column of a fault, and for two files with one id.
    """
    held = {effect.id for effect in chosen}
    found: dict[str, Path] = {}
    offered: list[Effect] = []
    for path in files:
        effect = read_own_effect(path)
        if effect.id in found and path.resolve() != found[effect.id].resolve():
            raise BadInput(
                f"two offered effects have the id {effect.id!r}",
                place=f"{found[effect.id]} and {path}",
                remedy="Give each an id of its own",
            )
        if effect.id not in found and effect.id not in held:
            offered.append(effect)
        found[effect.id] = path
    return offered


def own_effects(model: Path) -> dict[str, Effect]:
    """A lab's own effects that a model file holds, by name; BadInput with file and place."""
    return {
        name: effect_from_text(text, f"{model}, own_effects.{name}")
        for name, text in read_fit(model).own.items()
    }


def chosen_effects(machine: Machine, add: tuple[str, ...], model: Path | None) -> list[Effect]:
    """Effects of ``--model FILE`` and ``--add EFFECT``, each once, in that order.

    What ends in ``.toml`` after ``--add`` is an operator's own effect file.
    """
    chosen: dict[str, Effect] = {}
    if model is not None:
        own = own_effects(model)
        for name in read_fit(model).effects:
            chosen[name] = own.get(name) or effect_named(name, machine)
    for name in add:
        effect = (
            read_own_effect(Path(name)) if name.endswith(".toml") else effect_named(name, machine)
        )
        chosen[effect.id] = effect
    return list(chosen.values())
