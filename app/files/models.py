"""Model files: which effects are in the model, and what a fit of it found (TOML, ``pkm-model/1``).

What one session found is what ``fit``, ``apply`` and the next run begin with. A run itself is
never written to.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from app.files.text import read_text
from calib.arrays import Array
from calib.effects import Effect, Signature, Situation, Unknown, effect_named, is_shipped
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.identify import Fit, fit_report
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.toml_place import line_of

FORMAT = "pkm-model/1"


@dataclass(frozen=True)
class ModelFile:
    """What a model file says; ``values`` and ``sigmas`` are by parameter name.

    ``own`` holds the texts of the operator's own effects, so that the model file is complete.
    """

    machine: str
    effects: tuple[str, ...]
    own: dict[str, str] = field(default_factory=dict)
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
    own = table.get("own_effects", {})
    if not isinstance(own, dict) or not all(isinstance(text, str) for text in own.values()):
        raise BadInput("own_effects is no table of texts", place=str(path))
    return ModelFile(str(table.get("machine", "")), tuple(effects), own, values, sigmas)


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
        "compensation": compensation_of(fit),
        "own_effects": {
            effect.id: effect.text for effect in fit.model.effects if isinstance(effect, OwnEffect)
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
        "correlations": {
            name: [round(float(value), 6) for value in row[: index + 1]]
            for index, (name, row) in enumerate(zip(fit.model.names, correlation, strict=True))
        },
    }
    path.write_text(tomli_w.dumps(table), encoding="utf-8")


class OwnEffect(Effect):
    """An operator's effect together with the text of its file."""

    def __init__(self, effect: Effect, text: str) -> None:
        self.id, self.kind, self.says = effect.id, effect.kind, effect.says
        self.channels, self.depends = effect.channels, effect.depends
        self.text = text
        self._effect = effect

    def applies(self, machine: Machine) -> bool:
        """As the operator's effect says."""
        return self._effect.applies(machine)

    def unavailable(self, rows: Rows) -> str:
        """As the operator's effect says."""
        return self._effect.unavailable(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """As the operator's effect says."""
        return self._effect.unknowns(rows)

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """As the operator's effect says."""
        return self._effect.parts(rows)

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """As the operator's effect says."""
        return self._effect.trials(rows)

    def closure(self, machine: Machine, values: Array) -> Machine:
        """As the operator's effect says."""
        return self._effect.closure(machine, values)

    def rest(self, rows: Rows) -> Array:
        """As the operator's effect says."""
        return self._effect.rest(rows)

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """As the operator's effect says."""
        return self._effect.refined(rows, trial)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """As the operator's effect says."""
        return self._effect.signature(situation, values)


def read_own_effect(path: Path) -> OwnEffect:
    """Read an operator's effect file; raises BadInput with file, line and column of a fault."""
    text = read_text(path)
    effect = effect_from_text(text, str(path))
    if is_shipped(effect.id):
        raise BadInput(
            f"the id {effect.id!r} is that of an effect of the program",
            place=f"{path}, line {line_of(text, 'effect', 'id')}, id",
            remedy="Give the effect an id of its own",
        )
    return OwnEffect(effect, text)


def chosen_effects(
    machine: Machine, add: tuple[str, ...], model: Path | None
) -> tuple[list[Effect], ModelFile | None]:
    """Effects of ``--model FILE`` and ``--add EFFECT``, each once, in that order.

    What ends in ``.toml`` after ``--add`` is an operator's own effect file.
    """
    saved = read_model(model) if model is not None else None
    chosen: dict[str, Effect] = {}
    for name in saved.effects if saved else ():
        own = saved.own.get(name) if saved else None
        chosen[name] = (
            effect_named(name, machine)
            if own is None
            else OwnEffect(effect_from_text(own, f"{model}, own_effects.{name}"), own)
        )
    for name in add:
        effect = (
            read_own_effect(Path(name)) if name.endswith(".toml") else effect_named(name, machine)
        )
        chosen[effect.id] = effect
    return list(chosen.values()), saved
