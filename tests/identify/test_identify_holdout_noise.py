"""The floor of held-out poses counts what they share with the others of their noise."""

from dataclasses import replace

import numpy as np
import pytest

from calib.identify import fit
from calib.identify.fitting import with_noise
from calib.identify.holdout import hold_out, hold_out_of
from calib.model import Model
from calib.noise import Noise, drawn

WALK = Noise(scale=8.3, tau_s=26_000.0, share=0.985, step=0.28)


@pytest.mark.parametrize("noise", [WALK, Noise(visit=0.5)], ids=str)
def test_held_out_poses_are_as_far_off_as_the_floor_says(noise: Noise, example) -> None:
    found = with_noise(fit(Model(example("no-effect"))), noise)
    linear, rng = found.linear, np.random.default_rng(6)
    precision = found.prior_precision
    offs = [
        hold_out_of(
            found,
            drawn(found.taking, noise, 1, rng)[0],
            linear.jacobian,
            precision,
            np.sqrt(precision) * rng.standard_normal(precision.size),
            floor=False,
        ).rms_mm
        for _ in range(24)
    ]
    floor = hold_out(found).floor_mm
    assert float(np.sqrt(np.mean(np.square(offs)))) == pytest.approx(floor, rel=0.2)
    assert floor < 3.0 * hold_out(replace(found, noise=Noise(), whitening=None)).floor_mm
