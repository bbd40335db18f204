"""Several steps in one run: actuators that slipped more than once, a station that was put back.

The steps are found one by one from the nominal machine, each with the geometry freed, which two
steps at once would bend. The account holds if it leaves next to no misfit, and if nothing that is
smooth in time, belongs to a nest or is a known effect would do as well.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.effects import catalogue
from calib.effects.tracker import rigid_motions
from calib.identify.fitting import Fit
from calib.identify.signatures import effect_columns
from calib.look.bent import SLOW_S
from calib.look.boxes import Box, Sums
from calib.look.gravity import weight_fall
from calib.look.scan import excess, fit_together, from_nominal, scan, whitened, with_the_excluded
from calib.look.seat_off import each_seat
from calib.look.several import split
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

MOST = 4
"""Steps at most, a station or an actuator that came back counted once."""
FALL, SHARE = 100.0, 0.3
"""Least fall of the cost by one step, and least part of what is too much."""
LEFT = 1.3
"""Chi-square per degree of freedom that the account may leave."""
CLEAR = 60.0
"""Fall by which the steps together must beat what is smooth."""
UNBENT = 0.03
"""Part of what is too much that a known effect is given: it is seen from the nominal machine."""
WAVES = 6
"""Half waves in a run of what sways slowly: a tide is no station that is moved and put back."""
REFINED = 3
"""Times all sizes of actuators are found anew, the moments known: seen from the nominal machine,
then by fits."""
FARTHEST = 0.1
"""Part of its travel that no actuator slips and goes on."""
MOST_BAD = 3


@dataclass(frozen=True, eq=False)
class Found:
    """One step: the actuator (None: the frame), first reading and the one after its last."""

    actuator: int | None
    first: int
    last: int
    size: float = 0.0


def several_steps(machine: Machine, run: Run) -> tuple[list[Run], list[Remark]] | None:
    """The run with its steps taken back, in parts where the station moved; None if they do not do.

    Returns the parts and one remark for each step.
    """
    found: list[Found] = []
    before = view = from_nominal(machine, [run])
    if view is None or before is None or weight_fall(view) > FALL + SHARE * excess(view):
        return None
    parts, fitted = [run], None
    while len(found) < MOST and (fitted is None or not _good(fitted)):
        one = _next(view)
        if one is None:
            break
        found = _sized(machine, run, [*found, one])
        parts = _taken(run, found)
        view, fitted = from_nominal(machine, parts), fit_together(machine, parts)
        if view is None:
            return None
    if fitted is not None and _good(fitted):
        found, fitted = _fewest(machine, run, found, fitted)
        parts = _taken(run, found)
    if fitted is None or not _good(fitted) or (len(found) == 1 and _ends(found[0], run)):
        return None  # one step to the end is asked of elsewhere
    if any(_of_one_nest(before, one) for one in found):
        return None  # it was that nest that moved
    fall = excess(before) - max(excess(fitted), 0.0)
    known = _effects(before) + UNBENT * excess(before)
    if fall < max(_smooth(before), _nest_steps(before), known) + CLEAR:
        return None
    return parts, _remarks(machine, run, found, fitted, before)


def _fewest(machine: Machine, run: Run, found: list[Found], fitted: Fit) -> tuple[list[Found], Fit]:
    """The steps without those that the others make superfluous: a frame passes for an actuator."""
    for one in sorted(found, key=lambda one: one.actuator is not None):
        rest = _sized(machine, run, [other for other in found if not _same(one, other)])
        again = fit_together(machine, _taken(run, rest)) if rest else None
        if again is not None and _good(again) and excess(again) < excess(fitted) + CLEAR:
            found, fitted = rest, again
    return found, fitted


def _same(one: Found, other: Found) -> bool:
    return (one.actuator, one.first, one.last) == (other.actuator, other.first, other.last)


def _good(fitted: Fit) -> bool:
    return fitted.chi2_per_dof < LEFT and len(fitted.bad) <= MOST_BAD


def _of_one_nest(view: Fit, one: Found) -> bool:
    """Whether all readings on the platform within a step of the frame are of one nest."""
    rows = view.model.rows
    here = slice(one.first, one.last)
    on = np.flatnonzero(rows.on_platform[here])
    return one.actuator is None and len({rows.nest_name[here][k] for k in on}) == 1


def _ends(one: Found, run: Run) -> bool:
    return one.last == int(run.measured.sum())


def _next(view: Fit) -> Found | None:
    """The step, of the frame or of one actuator, that explains most."""
    situation, rows = view.linear.situation, view.model.rows
    kept = np.flatnonzero(view.accepted)
    least = max(FALL, SHARE * excess(view))
    best: tuple[float, int | None, Box] | None = None
    columns: list[tuple[int | None, Array]] = [
        (k, situation.actuator_columns[[k]][:, :, view.accepted])
        for k in range(len(rows.machine.actuators))
    ]
    columns.append((None, whitened(view, rigid_motions(situation.base_point))))
    for actuator, own in columns:
        box = Sums(view, own).best()
        # Six numbers of a frame explain a little more than one of an actuator by chance.
        worth = -1.0 if box is None else box.fall - (0.0 if actuator is not None else CLEAR)
        if box is not None and (best is None or worth > best[0]):
            best = worth, actuator, box
    if best is None or best[2].fall < least:
        return None
    _, actuator, box = best
    last = rows.count if box.last == kept.size else int(kept[box.last])
    size = float(box.sizes[0]) if actuator is not None else 0.0
    if actuator is not None and abs(size) > FARTHEST * np.ptp(rows.machine.q_limits[actuator]):
        return None
    return Found(actuator, int(kept[box.first]), last, size)


def _taken(run: Run, found: list[Found]) -> list[Run]:
    """The run with the actuators where they stood, in parts where the station moved."""
    read = np.flatnonzero(run.measured)
    q, edges = run.q.copy(), set()
    for one in found:
        if one.actuator is None:
            edges |= {one.first, one.last} - {read.size}
            continue
        first = read[one.first]
        last = run.line.size if one.last == read.size else read[one.last]
        q[one.actuator, first:last] += one.size
    return split(replace(run, q=q), sorted(edges))


def _sized(machine: Machine, run: Run, found: list[Found]) -> list[Found]:
    """The steps of the actuators with sizes that are found together."""
    own = [one for one in found if one.actuator is not None]
    for again in range(REFINED if own else 0):
        parts = _taken(run, found)
        view = fit_together(machine, parts) if again else from_nominal(machine, parts)
        if view is None:
            break
        view = with_the_excluded(view)
        number = np.arange(view.model.rows.count)
        columns = np.stack(
            [
                view.linear.situation.actuator_columns[one.actuator]
                * ((number >= one.first) & (number < one.last))
                for one in own
            ]
        )
        more = scan(view, columns[:, :, view.accepted]).sizes[0]
        own = [replace(one, size=one.size + float(by)) for one, by in zip(own, more, strict=True)]
        found = [*own, *(one for one in found if one.actuator is None)]
    return found


def _smooth(view: Fit) -> float:
    """Fall of the cost by all nests off, actuators and a frame that drift: nothing that steps.

    The frame as a series of cosines: stairs of three boxes are as near to a wave as it is to them.
    """
    situation, rows = view.linear.situation, view.model.rows
    columns = list(each_seat(view))
    shapes = [rows.progress, *(np.exp(-rows.time_s / tau) for tau in SLOW_S)]
    temperature = rows.channels.get("structure_temp_C")
    if temperature is not None and np.all(np.isfinite(temperature)):
        shapes.append(temperature - temperature.mean())
    columns += [(situation.actuator_columns * shape)[:, :, view.accepted] for shape in shapes]
    span = max(float(np.ptp(rows.time_s)), 1e-9)
    turns = np.pi * (rows.time_s - rows.time_s.min()) / span
    motions = rigid_motions(situation.point)
    drifts = [rows.progress, *(np.cos(m * turns) for m in range(1, WAVES + 1))]
    slow = np.concatenate([motions * drift for drift in drifts])
    columns.append(np.einsum("ijn,kjn->kin", situation.whitener, slow)[:, :, view.accepted])
    return float(scan(view, np.concatenate(columns)).fall[0])


def _effects(view: Fit) -> float:
    """Fall of the cost by the one known effect, without a moment or period, that explains most."""
    asked = effect_columns(view, catalogue(view.model.rows.machine))
    falls = [
        float(scan(view, one.at(0)[:, :, view.accepted]).fall[0])
        for one in asked
        if len(one.trials) == 1
    ]
    return max(falls, default=0.0)


def _nest_steps(view: Fit) -> float:
    """Fall of the cost by the one nest of the platform that moves at some moment, or is off."""
    return max((float(scan(view, one).fall.max()) for one in each_seat(view)), default=0.0)


def _remarks(
    machine: Machine, run: Run, found: list[Found], fitted: Fit, before: Fit
) -> list[Remark]:
    lines = run.line[run.measured]
    times = run.time_s[run.measured]
    said = []
    for one in found:
        here = lines[one.first : one.last]
        when = f"from line {here[0]} ({times[one.first]:.0f} s)" + (
            " on" if one.last == lines.size else f" to {here[-1]} ({times[one.last - 1]:.0f} s)"
        )
        if one.actuator is None:
            name, what = "station-moved", f"The tracker or the base stood elsewhere {when}"
            done = "The parts have frames of their own; nothing is excluded for it"
            remedy = "Nothing, or begin a new run after each move; fasten what was moved"
        else:
            axis = machine.actuators[one.actuator]
            name = "actuator-slipped"
            what = (
                f"{axis.name} is off by {one.size:+.3g} {axis.unit} {when}: it slipped, or lost "
                "counts"
            )
            done = f"Fitted with {axis.name} where it stood"
            remedy = f"See {axis.name} and its drive, home it, and measure again from there on"
        said.append(
            Remark(
                name,
                what,
                ranges(here, lines),
                f"With {len(found)} such step{'s' if len(found) > 1 else ''} chi-square per degree "
                f"of freedom is {fitted.chi2_per_dof:.3g}, without {before.chi2_per_dof:.3g}",
                done,
                remedy,
                True,
                run.source,
            )
        )
    return said
