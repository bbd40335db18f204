"""Model files: which effects are in the model, and what a fit of it found (TOML, ``pkm-model/1``).

What one session found is what ``fit``, ``apply`` and the next run begin with. A run itself is
never written to.
"""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from app.run_files import read_text
from calib.effects import Effect, effect_named
from calib.errors import BadInput
from calib.identify import Fit, fit_report
from calib.mechanism.description import Machine

FORMAT = "pkm-model/1"


@dataclass(frozen=True)
class ModelFile:
    """What a model file says; ``values`` and ``sigmas`` are by parameter name."""

    machine: str
    effects: tuple[str, ...]
    values: dict[str, float] = field(default_factory=dict)
    sigmas: dict[str, float] = field(default_factory=dict)


def read_model(path: Path) -> ModelFile:
    """Read a model file; raises BadInput naming the file and the key."""
    try:
        table = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"not valid TOML: {error}", place=str(path)) from error
    if table.get("format") != FORMAT:
        raise BadInput(
            f"format is {table.get('format')!r}", place=str(path), remedy=f'Expected "{FORMAT}"'
        )
    effects = table.get("effects", [])
    if not isinstance(effects, list) or not all(isinstance(name, str) for name in effects):
        raise BadInput(
            f"effects is {effects!r}", place=str(path), remedy="Expected a list of names"
        )
    parameters = table.get("parameters", [])
    try:
        values = {entry["name"]: float(entry["value"]) for entry in parameters}
        sigmas = {entry["name"]: float(entry["sigma"]) for entry in parameters}
    except (TypeError, KeyError, ValueError) as error:
        raise BadInput(
            f"an entry of [[parameters]] is not readable ({error})",
            place=str(path),
            remedy="Expected name, value and sigma",
        ) from error
    return ModelFile(str(table.get("machine", "")), tuple(effects), values, sigmas)


def write_model(path: Path, fit: Fit) -> None:
    """Write what a fit found, correlations included."""
    report = fit_report(fit)
    sigma = fit.sigmas
    correlation = fit.covariance / (sigma[:, None] * sigma)
    table: dict[str, Any] = {
        "format": FORMAT,
        "machine": fit.model.rows.runs[0].header.machine,
        "runs": [run.source for run in fit.model.rows.runs],
        "effects": report["effects"],
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
        "correlations": {
            name: [round(float(value), 6) for value in row[: index + 1]]
            for index, (name, row) in enumerate(zip(fit.model.names, correlation, strict=True))
        },
    }
    path.write_text(tomli_w.dumps(table), encoding="utf-8")


def chosen_effects(
    machine: Machine, add: tuple[str, ...], model: Path | None
) -> tuple[list[Effect], ModelFile | None]:
    """Effects named by ``--model FILE`` and ``--add EFFECT``, each once, in that order."""
    saved = read_model(model) if model is not None else None
    names = dict.fromkeys([*(saved.effects if saved else ()), *add])
    return [effect_named(name, machine) for name in names], saved
