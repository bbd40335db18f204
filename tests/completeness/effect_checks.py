"""What is asked of an effect: the page, the mock, the blind trial, its derivatives.

Each check answers with what is missing, in words; nothing here names an effect or a machine.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from made_run import machine_of, rows_of

from calib.effects import Effect, Situation, is_shipped
from calib.identify import fit
from calib.identify.fitting import Fit
from calib.identify.signatures import columns_at
from calib.model import Model
from calib.model.columns import at_trial, whitened_columns
from calib.model.prediction import State
from calib.runs import parse_run
from calib.runs.stack import stack
from calib.unknown import Unknown
from mocks.hidden import HiddenEffect
from mocks.hidden.effect import Site
from mocks.hidden.table import Hidden
from mocks.physics.arm_body import ArmBody, is_arm
from mocks.physics.bodies import BODIES, body_named
from mocks.physics.body import Body
from mocks.physics.truth import nominal_parameters
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

PAGE = Path(__file__).parents[2] / "docs" / "effects.md"
PROFILE = Profile(rise_K=8.0, payload_kg=(0.0, 12.0))
ALIKE = 0.03
"""Part of the largest displacement by which the mock and the columns may differ."""


def repeated_names(effects: Sequence[Effect], name: str) -> Iterator[str]:
    """Identifiers and names of unknowns that two things of one machine share."""
    rows = rows_of(name)
    known = [parameter.name for parameter in rows.machine.parameters]
    for one in [[effect.id for effect in effects],
                known + [u.name for effect in effects for u in effect.unknowns(rows)]]:  # fmt: skip
        for twice in sorted({each for each in one if one.count(each) > 1}):
            yield f"{name}: the name {twice} is used twice"


def misnamed(effect: Effect, name: str) -> Iterator[str]:
    """Unknowns whose names do not begin with the effect's."""
    for unknown in effect.unknowns(rows_of(name)):
        if not unknown.name.startswith(f"{effect.id}."):
            yield f"{name}: the unknown {unknown.name} does not begin with {effect.id}."
        if not unknown.size > 0.0:
            yield f"{name}: {unknown.name} has no usual size"


def undocumented(effect: Effect, name: str, page: str) -> Iterator[str]:
    """What docs/effects.md does not say, or says differently: kind; unit, size and prior."""
    kinds = dict(re.findall(r"^\| `([a-z-]+)` \| (machine|measurement) \|", page, re.MULTILINE))
    if effect.id not in kinds:
        yield f"docs/effects.md has no row for {effect.id}"
    elif kinds[effect.id] != effect.kind:
        yield f"docs/effects.md calls {effect.id} {kinds[effect.id]}, it is {effect.kind}"
    stated = list(stated_sizes(page))
    for unknown in effect.unknowns(rows_of(name)):
        own = [row for row in stated if row[0].fullmatch(unknown.name)]
        if not any(_agrees(row, unknown) for row in own):
            yield f"docs/effects.md: no row with unit, size and prior of {unknown.name}: {unknown}"


def stated_sizes(page: str) -> Iterator[tuple[re.Pattern[str], str, str, str]]:
    """Rows of the page's table of unknowns: pattern of the name, unit, size, prior."""
    table = page.partition("| unknown | unit | size | prior |")[2].partition("\n\n")[0]
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 4 and cells[0].startswith("`"):
            pattern = re.escape(cells[0].strip("`")).replace(r"\*", ".*")
            yield re.compile(pattern), cells[1], cells[2], cells[3]


def _agrees(row: tuple[re.Pattern[str], str, str, str], unknown: Unknown) -> bool:
    _, unit, size, prior = row
    if unit != unknown.unit:
        return False
    if prior == "searched" or unknown.nonlinear:
        return prior == "searched" and unknown.nonlinear
    return float(size) == unknown.size and (float(prior) if prior else None) == unknown.sigma


def stale_rows(page: str) -> Iterator[str]:
    """Rows of docs/effects.md about effects that nobody ships."""
    for found in re.findall(r"^\| `([a-z0-9-]+)[.`]", page, re.MULTILINE):
        if not is_shipped(found):
            yield f"docs/effects.md has a row for {found}, which is not shipped"


def unsimulated(effect: Effect, name: str, hidden: Sequence[HiddenEffect]) -> Iterator[str]:
    """What the mocks lack: the effect, a case that shows it, a draw for the blind trial."""
    body = body_for(name)
    if body is None:
        return
    mine = next((each for each in hidden if each.id == effect.id), None)
    if mine is None:
        yield f"mocks/hidden has no {effect.id}"
        return
    if not mine.of(body.kind):
        yield f"the mock {name} cannot have {effect.id}"
        return
    site = site_of(name)
    names = {unknown.name for unknown in effect.unknowns(nominal_run(name)[1].model.rows)}
    for what, make in (
        ("example", lambda: mine.example(site)),
        ("draw", lambda: mine.draw(site, np.random.default_rng(1))),
    ):
        try:
            table = make()
        except NotImplementedError:
            yield f"mocks/hidden: {effect.id} has no {what} for the {name}"
            continue
        try:
            Hidden(table).check(body.kind, site.limbs)
        except ValueError as error:
            yield f"mocks/hidden: {what} of {effect.id}: {error}"
        if not set(table) & names:
            yield f"mocks/hidden: {what} of {effect.id} names none of its unknowns"
    if name in mine.unseen and not effect.beside:
        yield f"the blind trial never draws {effect.id} on the {name}"


def unlike_the_mock(effect: Effect, name: str, hidden: Sequence[HiddenEffect]) -> Iterator[str]:
    """Readings that the mock's own physics moves otherwise than the effect's columns say."""
    mine = next((each for each in hidden if each.id == effect.id), None)
    if body_for(name) is None or mine is None or not mine.linear:
        return
    plain, fitted = nominal_run(name)
    span = float(plain.layout.time[-1])
    table = mine.example(replace(site_of(name), span_s=span))
    moved = simulate(replace(plain.plan, hidden=Hidden(table))).xyz - plain.xyz
    seen = moved[plain.layout.reading].T
    rows = fitted.model.rows
    unknowns = effect.unknowns(rows)
    trial = tuple(table.get(u.name, 0.0) for u in unknowns if u.nonlinear)
    columns = columns_at(fitted, effect, (trial,)).at(0)
    linear = [unknown.name for unknown in unknowns if not unknown.nonlinear]
    amounts = np.array([table.get(name, 0.0) for name in linear])
    predicted = rows.in_mm(np.tensordot(amounts, columns, axes=1))
    largest = float(np.abs(seen).max())
    if largest < 1e-3:
        yield f"{name}: the example of {effect.id} moves no reading by a micrometre"
    elif np.abs(predicted - seen).max() > ALIKE * largest:
        worst = float(np.abs(predicted - seen).max())
        yield f"{name}: {effect.id} moves the mock by {largest:.3g} mm, {worst:.3g} mm otherwise"


def body_for(name: str) -> Body | None:
    """The physics of a machine; None for one that there is no mock of."""
    if name in BODIES:
        return body_named(name)
    machine = machine_of(name)
    return ArmBody(machine) if is_arm(machine) else None


def site_of(name: str) -> Site:
    body = body_for(name)
    assert body is not None
    return Site(body.kind, body.limbs, tuple(body.around.platform_nests), body.stroke)


@cache
def nominal_run(name: str) -> tuple[SimulatedRun, Fit]:
    """A mock exactly as drawn, without noise worth the name, and the fit to it."""
    nominal = nominal_parameters(machine_of(name))
    plan = RunPlan(machine=name, own_body=body_for(name), seed=5, poses=12, noise_mm=1e-5,
                   parameters=nominal, profile=PROFILE, delays=True)  # fmt: skip
    run = simulate(plan)
    actuators = len(machine_of(name).actuators)
    rows = stack(machine_of(name), [parse_run(run_toml(run), points_csv(run), actuators=actuators)])
    return run, fit(Model(rows))


@cache
def frames_of(name: str) -> State:
    """Where the tracker stands in the made run of a machine."""
    return fit(Model(rows_of(name))).linear.state


def wrong_columns(effect: Effect, name: str) -> Iterator[str]:
    """Unknowns whose analytic column is not the difference of two predictions."""
    rows = rows_of(name)
    if reason := effect.unavailable(rows):
        yield f"{name}: {effect.id} is unavailable in a run that has everything: {reason}"
        return
    model = Model(rows, [effect])
    unknowns = model.unknowns[0]
    generator = np.random.default_rng(5)
    trials = list(effect.trials(rows))
    values = at_trial(unknowns, trials[len(trials) // 3]) + effect.rest(rows)
    drawn = generator.standard_normal(machine_of(name).nominal.size)
    small = [0.0 if u.nonlinear else 0.05 * u.size for u in unknowns]
    values += small * generator.standard_normal(len(unknowns))
    frame = frames_of(name)
    machine = machine_of(name)
    begin = replace(
        model.start(frame.frame_rotation, frame.frame_position),
        # not the drawing itself: what over-constrains a machine has nothing to do there
        parameters=machine.nominal + 0.2 * machine.prior_sigma * drawn,
        effects=(values,),
    )
    linear = model.linearise(model.linearise(begin).state)
    first = model.free.size
    for index, unknown in enumerate(unknowns):
        own = linear.jacobian[first + index]
        if unknown.nonlinear and not own.any():
            continue  # it is searched for, never moved
        size = (1e-5 * values[index]) if unknown.nonlinear else 0.02 * unknown.size
        step = np.zeros(model.prior.size)
        step[first + index] = size
        ahead, back = (model.predict(model.moved(linear.state, s * step)) for s in (1.0, -1.0))
        slope = np.einsum("ijn,jn->in", rows.whitener, (ahead - back) / (2.0 * size))
        off, largest = np.abs(own - slope).max(), np.abs(slope).max()
        if largest == 0.0:
            if _moves_at_another(effect, linear.situation, unknowns, index, trials):
                continue
            yield f"{name}: {unknown.name} moves no reading"
        elif off > 3e-3 * largest:
            yield f"{name}: the column of {unknown.name} is off by {off / largest:.2g} of itself"


def _moves_at_another(
    effect: Effect,
    situation: Situation,
    unknowns: Sequence[Unknown],
    index: int,
    trials: Sequence[tuple[float, ...]],
) -> bool:
    """Whether an unknown moves a reading at another place, period or moment that is searched."""
    return any(
        whitened_columns(effect.signature(situation, at_trial(unknowns, trial)), situation)[
            index
        ].any()
        for trial in trials
    )


def complaints(
    effect: Effect, name: str, page: str, hidden: Sequence[HiddenEffect]
) -> Iterable[str]:
    """Everything that is missing of one effect on one machine."""
    yield from misnamed(effect, name)
    yield from undocumented(effect, name, page)
    yield from unsimulated(effect, name, hidden)
    yield from unlike_the_mock(effect, name, hidden)
    yield from wrong_columns(effect, name)
