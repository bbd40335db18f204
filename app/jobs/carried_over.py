"""The unknowns of a saved model as other runs of the same machine have them."""

import re
from pathlib import Path

import numpy as np

from app.files.fits import SavedFit
from calib.arrays import Array
from calib.errors import BadInput
from calib.identify.predicting import Known
from calib.model.prediction import Model


def same_machine(saved: SavedFit, model: Model) -> None:
    """Raise BadInput for a run of another machine."""
    machine = model.machine
    known = any(p.name in saved.estimates for p in machine.parameters)
    named = Path(saved.machine).name.removesuffix(".toml")
    if (named and named != machine.name) or not known:
        raise BadInput(
            f'the model is of "{saved.machine}", the run of "{machine.name}"',
            place=saved.source,
            remedy="Name a run of the machine that the model is of",
        )


def known_to(
    saved: SavedFit, model: Model, frame: bool, remarks: list[str]
) -> tuple[Known, tuple[str, ...]]:
    """Values and covariance in the model's order; names of unknowns that the file lacks.

    ``frame``: where the tracker stands is fitted to the new runs. ``remarks`` is added to.

    Raises
    ------
    BadInput
        If a value, or the one place of the tracker, is not there.
    """
    names = list(saved.estimates)
    over = _over(model, remarks, frame)
    at = [None if name in over else _place_in(saved, name, model, frame) for name in model.names]
    values = model.centre.copy()  # of what the file lacks
    at_rest = np.concatenate([np.zeros(0), *model.effects_at_rest])
    values[model.free.size : model.free.size + at_rest.size] = at_rest
    select = np.zeros((len(at), len(names)))
    lacking = []
    own = np.zeros(len(at))
    for k, (name, held) in enumerate(zip(model.names, at, strict=True)):
        if held is not None:
            values[k] = saved.estimates[held].value
            select[k, names.index(held)] = 1.0
            if not np.isfinite(values[k]):
                raise BadInput(
                    f"{held} has no value", place=saved.source, remedy="Save the model again"
                )
        elif np.isfinite(model.prior[k]) and name not in over:
            lacking.append(name)
            own[k] = model.prior[k] ** 2
    unsure = [name for name in names if not np.isfinite(saved.estimates[name].sigma)]
    if unsure:
        remarks.append(
            f"the model file does not say how uncertain {', '.join(unsure[:3])} is: taken as exact"
        )
    covariance = select @ np.nan_to_num(saved.covariance) @ select.T + np.diag(own)
    if not saved.correlated:
        remarks.append(
            "the model file has no correlations, so that what is expected is too large or too "
            "small: use the file of pkmcal fit --save"
        )
    _compensated(saved, model, values, remarks)
    return Known(values, covariance), tuple(lacking)


def _over(model: Model, remarks: list[str], frame: bool) -> frozenset[str]:
    """Unknowns whose values were of the model's runs and say nothing of these."""
    gone: set[str] = set()
    for effect, unknowns in zip(model.effects, model.unknowns, strict=True):
        if not effect.of_its_run:
            continue
        gone |= {one.name for one in unknowns if not one.nonlinear}
        with_frame = frame and effect.kind == "measurement" and not effect.ends_with_run
        remarks.append(
            f"{effect.id}: fitted to these runs with the place of the tracker"
            if with_frame
            else f"{effect.id}: what it was in the runs of the model says nothing of these: "
            "nothing of it is predicted"
        )
    return frozenset(gone)


def _place_in(saved: SavedFit, name: str, model: Model, frame: bool) -> str | None:
    """Name in the file of an unknown of the model; raises BadInput for a frame that is not there.

    A model of one run has one frame, where the tracker stood; other runs are taken from there.
    """
    if ".frame." not in f".{name}":
        return name if name in saved.estimates else None
    if frame:
        return None
    one = re.sub(r"^run\d+\.", "", name)
    if one not in saved.estimates:
        raise BadInput(
            "the model was fitted to several runs: it has no one place of the tracker",
            place=saved.source,
            remedy="Let the place of the tracker be fitted: --frame",
        )
    return one


def _compensated(saved: SavedFit, model: Model, values: Array, remarks: list[str]) -> None:
    """Take off what the controller compensated here beyond what it did for the model's runs."""
    held = [dict(run.header.compensation) for run in model.rows.runs]
    before = saved.compensation or {}
    names = dict.fromkeys([*before, *(name for one in held for name in one)])
    for name in names:
        here = {one.get(name, 0.0) for one in held}
        if here == {before.get(name, 0.0)}:
            continue
        if len(here) > 1 or name not in model.names:
            raise BadInput(
                f"the controller compensated {name} otherwise than for the model's runs",
                place=model.rows.runs[0].source,
                remedy="Predict runs that were taken as those of the model, one at a time",
            )
        (now,) = here
        values[model.names.index(name)] -= now - before.get(name, 0.0)
        remarks.append(f"{name}: what the controller compensates by now is taken off")
