"""What a fit would write where the host computes the motion: the whole model, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.fits import SavedFit
from app.files.machines import load_machine
from app.hosted.parameters import ParameterSet
from app.writeback.gates import Gates, HostedSets, gates_of_proposal
from app.writeback.proposal import propose
from calib.errors import BadInput
from calib.unknown import Estimate, Unknown

MACHINE = load_machine("hexapod")
NOMINAL = {p.name: p.nominal for p in MACHINE.parameters}
LOST = {f"backlash.leg{i}": 0.02 for i in range(1, 7)}
OWN = """
[effect]
id = "door"
expression = "k * door_open"
unknowns = { k = "mm" }
"""
SEEN = '[effect]\nid = "haze"\nacts_on = "point"\nexpression = "k * t"\nunknowns = { k = "mm/s" }\n'


def made(effects: tuple[str, ...], own: dict[str, str], **values: float) -> SavedFit:
    """A fit of these effects; names with ``__`` for dots and ``_`` for hyphens of ids."""
    said = {**NOMINAL, **values}
    estimates = {n: Estimate(Unknown(n, "mm"), v, 1e-3) for n, v in said.items()}
    quality = {"chi2_per_dof": 1.0, "holdout_rms_um": 9.0, "holdout_floor_um": 9.0}
    covariance = 1e-6 * np.eye(len(estimates))
    return SavedFit("made.toml", "hexapod", effects, estimates, quality, covariance, False, {}, own)


def test_every_effect_of_the_machine_is_written_with_what_was_searched_for() -> None:
    values = {
        **LOST,
        "gravity-sag.c": 1e-4,
        "settling.k": 1e-3,
        "settling.tau": 2.0,
        "tracker-scale.k": 1e-6,
        **{f"door.leg{i}.k": 0.01 for i in range(1, 7)},
        "haze.k": 1e-6,
    }
    effects = ("backlash", "gravity-sag", "settling", "tracker-scale", "door", "haze")
    proposal = propose(
        MACHINE, made(effects, {"door": OWN, "haze": SEEN}, **values), NOMINAL, hosted=True
    )
    assert set(proposal.left_out) == {"tracker-scale", "haze"}
    assert proposal.own == {"door": OWN}
    new = proposal.over(NOMINAL)
    assert new["settling.tau"] == 2.0
    assert ParameterSet(new, proposal.own).checked(MACHINE).values == new


def test_writing_a_fit_twice_writes_the_same_values() -> None:
    fit = made(("backlash",), {}, **LOST)
    held = propose(MACHINE, fit, NOMINAL, hosted=True).over(NOMINAL)
    again = propose(MACHINE, fit, held, hosted=True)
    assert again.over(held) == held
    assert not again.given_up
    assert all(change.new == change.old for change in again.changes)


def test_what_the_fit_does_not_have_is_no_longer_compensated() -> None:
    held = {**NOMINAL, **LOST, "gravity-sag.c": 1e-4}
    proposal = propose(MACHINE, made(("backlash",), {}, **LOST), held, hosted=True)
    assert proposal.given_up == ("gravity-sag.c",)
    assert "gravity-sag.c" not in proposal.over(held)


def test_a_fit_beside_what_a_controller_compensated_is_refused() -> None:
    fit = replace(made(("backlash",), {}, **LOST), compensation={"backlash.leg2": 0.01})
    with pytest.raises(BadInput, match="beside"):
        propose(MACHINE, fit, NOMINAL, hosted=True)


@pytest.mark.parametrize("more", [0.02, 0.0])
def test_a_gain_by_an_effect_alone_passes_the_gate_and_none_does_not(more: float) -> None:
    """The geometry is as it was; the gain is what the newly named effect takes away."""
    found = {name: value + more for name, value in LOST.items()}
    fit = made(("backlash",), {}, **found)
    held = {**NOMINAL, **LOST}
    proposal = propose(MACHINE, fit, held, hosted=True)
    sets = HostedSets(
        ParameterSet(held).identified(MACHINE, None),
        ParameterSet(proposal.over(held)).identified(MACHINE, None),
    )
    checked = gates_of_proposal(Gates.with_limits({}), MACHINE, fit, proposal, held, sets)
    (gain,) = [gate for gate in checked if gate.gate == "gain"]
    assert gain.passed is (more > 0.0)
