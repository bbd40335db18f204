"""Fits that count with their noise: that of a model file, else what the readings demand."""

from pathlib import Path

from app.files.fits import read_fit
from calib.discover.plain_noise import with_own_noise
from calib.effects import catalogue
from calib.identify import Fit
from calib.identify.fitting import with_noise


def noisy(fit: Fit, model: Path | None) -> Fit:
    """Count with the noise of the model, where its file has some; else with what there is."""
    known = with_noise_of(fit, model)
    return known if known is not fit else with_own_noise(fit, lambda: catalogue(fit.model.machine))


def with_noise_of(fit: Fit, model: Path | None) -> Fit:
    """Count with the noise of a model file; where it has none the fit is as it was."""
    saved = None if model is None else read_fit(model).noise
    return fit if saved is None else with_noise(fit, saved.noise, saved.components)
