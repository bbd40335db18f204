"""How far each effect of a model moves what the tracker reads: its size where it matters."""

from dataclasses import dataclass, replace

import numpy as np

from calib.errors import BadInput
from calib.identify.fitting import Fit


@dataclass(frozen=True)
class Reach:
    """RMS and largest distance, um, by which an effect moves the SMR centre on the platform."""

    rms_um: float
    largest_um: float


def reach_of_effects(fit: Fit) -> dict[str, Reach]:
    """Predict the fitted readings of platform nests without each effect in turn.

    Returns
    -------
    dict
        By the effect's id; effects without which the machine does not close are missing.
    """
    model, state = fit.model, fit.linear.state
    counted = fit.accepted & model.rows.on_platform
    whole = model.predict(state)
    found: dict[str, Reach] = {}
    for index, effect in enumerate(model.effects):
        values = list(state.effects)
        values[index] = model.effects_at_rest[index]
        try:
            without = model.predict(replace(state, effects=tuple(values)))
        except BadInput:
            continue
        moved = 1e3 * np.linalg.norm((whole - without)[:, counted], axis=0)
        if moved.size:
            found[effect.id] = Reach(float(np.sqrt(np.mean(moved**2))), float(moved.max()))
    return found
