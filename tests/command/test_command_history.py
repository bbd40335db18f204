"""What was commanded before counts as the effects themselves say, however it is told."""

from dataclasses import replace

import numpy as np
import pytest
from command_cases import LOAD, around, drawn, machine_of, wanted_of

from calib.command import History, Identified, Surroundings, commands_for, standpoint
from calib.command.identified import commandable
from calib.effects import catalogue, effect_named
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.mechanism.task import task_error
from calib.model import Model
from calib.model.prototype import prototype_run
from calib.poses import sample_poses
from calib.runs.stack import stack

OWN = """[effect]
id = "half-of-the-step"
says = "what is left of the last step"
expression = "k * step * exp(-delay_s / tau)"
unknowns = { k = { unit = "1", size = 1e-3 }, tau = { unit = "s", from = 0.5, to = 5.0 } }
"""
REMEMBERING = ["backlash", "settling", "creep"]


def remembering(machine, generator):
    effects = [effect_named(name, machine) for name in REMEMBERING]
    return drawn(machine, [*effects, effect_from_text(OWN, "own.toml")], generator)


LARGE = (0.0, 0.3, 0.4, 0.2, 0.25, 0.8, 0.7, 0.75, 0.2, 0.9)
SMALL = (0.0, 0.3, 0.3001, 0.3, 0.3, 0.29995, 0.7, 0.7004, 0.7, 0.9)


def there_and_back(name, generator, shares=LARGE):
    """Poses on a line that turn round again and again, by steps large or small."""
    one, other = wanted_of(name)[:, 0], wanted_of(name)[:, 1]
    share = np.array(shares)
    return one[:, None] + (other - one)[:, None] * share, around(generator, share.size)


@pytest.mark.parametrize("name", ["hexapod", "arm"])
def test_command_of_a_sequence_is_the_commands_one_by_one(name):
    machine, generator = machine_of(name), np.random.default_rng(5)
    identified = remembering(machine, generator)
    wanted, here = there_and_back(name, generator)
    together = commands_for(identified, wanted, here)
    assert together.solved.all()
    history = History.at_home(machine)
    near = None
    for k in range(wanted.shape[1]):
        now = Surroundings({c: float(v[k]) for c, v in here.channels.items()}, here.time_s[k])
        one = commands_for(identified, wanted[:, k : k + 1], now, history, start=near)
        assert np.allclose(one.extension[:, 0], together.extension[:, k], rtol=0, atol=1e-7)
        history, near = one.history, one.standing.closed
    assert np.array_equal(history.extension.shape, together.history.extension.shape)


@pytest.mark.parametrize("name", ["hexapod", "ptm"])
def test_command_of_steps_smaller_than_the_lost_motion_brings_the_platform_there(name):
    machine, generator = machine_of(name), np.random.default_rng(5)
    identified = remembering(machine, generator)
    wanted, here = there_and_back(name, generator, SMALL)
    found = commands_for(identified, wanted, here)
    assert found.solved.all()
    poses = standpoint(identified, found.extension, here).poses
    error = task_error(machine.task, wanted, poses.position, poses.rotation)
    assert np.abs(error).max() < 1e-6


def test_command_counters_lost_motion_by_the_direction_of_the_commands_themselves():
    machine = machine_of("hexapod")
    plays = {f"backlash.{axis.name}": 0.02 for axis in machine.axes}
    identified = Identified.from_values(machine, plays, [effect_named("backlash", machine)])
    wanted, _ = there_and_back("hexapod", np.random.default_rng(1))
    found = commands_for(identified, wanted)
    plain = Identified.from_values(machine, {})
    without = commands_for(plain, wanted).extension
    way = np.hstack([found.history.extension[:, :1], found.extension])
    change = np.diff(way)
    change[np.abs(change) <= 1e-4] = 0.0
    last = np.zeros(6)
    for k in range(wanted.shape[1]):
        last = np.where(change[:, k] != 0.0, np.sign(change[:, k]), last)
        assert np.allclose(found.extension[:, k], without[:, k] + 0.01 * last, atol=1e-7)
    assert (np.diff(np.sign(change)) != 0).any()


@pytest.mark.parametrize("effects", [["backlash", "settling"], ["creep"]])
def test_command_after_a_condensed_history_is_the_same(effects):
    machine, generator = machine_of("hexapod"), np.random.default_rng(2)
    chosen = [effect_named(name, machine) for name in effects]
    identified = drawn(machine, chosen, generator)
    wanted, here = there_and_back("hexapod", generator)
    long = commands_for(identified, wanted, here).history
    short = long.condensed(identified.motion, whole_path=identified.remembers_path)
    later = Surroundings({"delay_s": 1.0}, 900.0)
    answers = [
        commands_for(identified, wanted_of("hexapod")[:, 3:4], later, history).extension
        for history in (long, short)
    ]
    assert np.allclose(*answers, rtol=0.0, atol=1e-10)
    assert short.count == (long.count if identified.remembers_path else 2)


def test_command_alternatives_each_come_next():
    machine, generator = machine_of("hexapod"), np.random.default_rng(6)
    identified = remembering(machine, generator)
    wanted, here = there_and_back("hexapod", generator)
    begin = commands_for(identified, wanted, here).history
    later = Surroundings({"delay_s": 1.0}, 900.0)
    several = commands_for(identified, wanted_of("hexapod"), later, begin, alternatives=True)
    for k in range(wanted_of("hexapod").shape[1]):
        one = commands_for(identified, wanted_of("hexapod")[:, k : k + 1], later, begin)
        assert np.allclose(several.extension[:, k], one.extension[:, 0], rtol=0.0, atol=1e-8)
    assert several.history is begin


def test_command_that_is_refused_is_not_on_the_way():
    machine, generator = machine_of("hexapod"), np.random.default_rng(8)
    identified = remembering(machine, generator)
    wanted, here = there_and_back("hexapod", generator)
    far, outside = wanted[:, 4:5].copy(), wanted[:, 4:5].copy()
    far[:3] *= 1e6
    outside[2] += 25.0
    longer = np.hstack([wanted[:, :4], far, outside, wanted[:, 4:]])
    times = np.concatenate([here.time_s[:4], [121.0, 122.0], here.time_s[4:]])
    channels = {c: np.concatenate([v[:4], v[:2], v[4:]]) for c, v in here.channels.items()}
    found = commands_for(identified, longer, Surroundings(channels, times))
    assert "cannot be reached" in found.refused[4]
    assert "passes a limit: q" in found.refused[5]
    assert np.isnan(found.extension[:, 4:6]).all()
    left = np.delete(found.extension, [4, 5], axis=1)
    assert np.allclose(left, commands_for(identified, wanted, here).extension, atol=1e-8)


def test_command_where_no_command_makes_up_for_an_effect_is_refused():
    machine = machine_of("hexapod")
    turned = {f"backlash.{axis.name}": -0.05 for axis in machine.axes}
    identified = Identified.from_values(machine, turned, [effect_named("backlash", machine)])
    task = np.repeat(wanted_of("hexapod")[:, :1], 4, axis=1)
    task[2] += [0.0, 1.0, 1.01, 1.5]
    assert commands_for(identified, task).solved.all()
    back = task.copy()
    back[2, 2] = task[2, 1] - 0.01  # less than the lost motion that is no play
    found = commands_for(identified, back)
    assert "does not converge" in found.refused[2]
    assert found.solved[:2].all()
    assert "comes after" in found.refused[3]


def test_command_needs_to_be_told_what_its_effects_depend_on():
    machine = machine_of("hexapod")
    effects = {e.id: e for e in catalogue(machine)}
    warm = Identified.from_values(machine, {"thermal-growth.a": 1e-5}, [effects["thermal-growth"]])
    with pytest.raises(BadInput, match="thermal-growth depends on structure_temp_C"):
        commands_for(warm, wanted_of("hexapod"))
    creeping = Identified.from_values(
        machine, {"creep.k": 1e-3, "creep.tau": 300.0}, [effects["creep"]]
    )
    with pytest.raises(BadInput, match="creep depends on the time"):
        commands_for(creeping, wanted_of("hexapod"))
    with pytest.raises(BadInput, match="do not go back"):
        commands_for(creeping, wanted_of("hexapod"), Surroundings({}, [5.0, 4, 6, 7, 8, 9]))
    with pytest.raises(BadInput, match="payload_kg has the shape"):
        commands_for(creeping, wanted_of("hexapod"), Surroundings({"payload_kg": np.zeros(2)}, 1.0))
    with pytest.raises(BadInput, match=r"lacks a value of creep\.tau"):
        Identified.from_values(machine, {"creep.k": 1e-3}, [effects["creep"]])
    with pytest.raises(BadInput, match=r"no \(6, N\)"):
        commands_for(warm, np.zeros((3, 4)))


def test_command_never_counters_what_only_the_measurement_does():
    machine = machine_of("hexapod")
    measured = [e for e in catalogue(machine) if e.kind == "measurement"]
    assert measured
    values = {"tracker-scale.k": 1e-4, "tracker-offset.r0": 0.1}
    assert Identified.from_values(machine, values, measured).effects == ()


def test_command_never_counters_what_happened_in_one_run():
    machine = machine_of("hexapod")
    over = [effect_named(name, machine) for name in ("actuator-step", "warm-up")]
    values = {"warm-up.run1.A": 0.1, "actuator-step.leg1": 0.2}
    assert Identified.from_values(machine, values, over).effects == ()


def test_command_settling_without_delays_is_the_product_that_the_run_knew():
    machine = machine_of("hexapod")
    effect = effect_named("settling", machine)
    product = Identified.from_values(machine, {"settling.k": 1e-3}, [effect])
    assert product.needs == ()
    both = Identified.from_values(machine, {"settling.k": 2e-3, "settling.tau": 1.0}, [effect])
    assert both.needs == ("delay_s",)
    here = Surroundings({"delay_s": np.log(2.0)})
    answers = [commands_for(one, wanted_of("hexapod"), here).extension for one in (product, both)]
    assert np.allclose(*answers, rtol=0.0, atol=1e-8)


def test_command_stands_where_the_identification_says_that_the_readings_are():
    machine, generator = machine_of("hexapod"), np.random.default_rng(4)
    effects = [e for e in catalogue(machine) if commandable(e) and e.id != "creep"]
    identified = drawn(machine, effects, generator)
    poses = sample_poses(machine, 5, generator)
    run = prototype_run(machine, "hexapod", poses, machine.nominal, 0.005, generator).run
    count = run.time_s.size
    channels = {
        "structure_temp_C": 20.0 + 0.1 * np.arange(count),
        "payload_kg": 5.0 + np.zeros(count),
        "delay_s": 1.0 + np.arange(count) % 3,
    }
    run = replace(run, header=replace(run.header, load=LOAD), channels=channels)
    rows = stack(machine, [run])
    model = Model(rows, effects)
    began = model.start(np.eye(3)[:, :, None], np.zeros((3, 1)))
    state = replace(
        began,
        parameters=identified.parameters,
        effects=tuple(found.values for found in identified.effects),
    )
    for _ in range(4):
        state = model.linearise(state).state
    q = run.q
    stands = standpoint(
        identified,
        machine.extension(q)[:, 1:],
        Surroundings({c: v[1:] for c, v in channels.items()}, run.time_s[1:]),
        History.at(machine.extension(q)[:, 0], run.time_s[0]),
    )
    nests = {**run.header.platform_nests}
    seen = [k for k in range(1, count) if run.nest[k] in nests]
    local = np.array([nests[run.nest[k]] for k in seen]).T
    points = stands.poses.take(np.array(seen) - 1).points(local)
    assert np.allclose(points, model.predict(state)[:, rows.on_platform], rtol=0.0, atol=1e-6)
