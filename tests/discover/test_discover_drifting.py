"""A step that the record shows is left open where noise that wanders explains it as well."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.discover.discovery import RunStage
from calib.discover.drifting import drift_or_step
from calib.evidence.forward import Discovery, Revision
from calib.runs.remark import Remark

MOVED = Remark(
    "station-moved", "The tracker was moved", (), "One step explains it", "It is in", "Fasten it",
    True,
)  # fmt: skip
OTHER = replace(MOVED, name="nests-exchanged", says="Nests 1 and 2 are exchanged")


def stage(tau_s: float, *called: str, out: int = 0) -> RunStage:
    """A stage by its noise, what is called for in it, and how many readings are left out."""
    fit: Any = SimpleNamespace(noise=SimpleNamespace(tau_s=tau_s), accepted=np.arange(9) >= out)
    asked: Any = SimpleNamespace(fit=fit, diagnosis=SimpleNamespace(explained_by=called))
    return RunStage((), 1.0, fit, lambda _: asked)


@pytest.mark.parametrize(
    ("tau_s", "called", "out", "left_open"),
    [
        (2e4, (), 0, True),
        (2e4, ("frame-shift",), 0, False),
        (0.0, (), 0, False),
        (2e4, (), 3, False),
    ],
)
def test_a_step_is_left_open_where_only_white_noise_calls_for_it(
    tau_s: float, called: tuple[str, ...], out: int, left_open: bool
) -> None:
    steps = (
        Revision(stage(0.0, *called, out=out)),
        Revision(stage(tau_s), added="frame-shift"),
    )
    said, other = drift_or_step((MOVED, OTHER), Discovery(steps, (), ()))
    assert other == OTHER
    assert (said == MOVED) is not left_open
    assert said.settled is not left_open
    assert ("drifts slowly" in said.says) is left_open


def test_without_a_step_nothing_changes() -> None:
    assert drift_or_step((MOVED,), Discovery((Revision(stage(2e4)),), (), ())) == (MOVED,)
