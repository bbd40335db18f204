"""The first look at runs: plain hypotheses about the record, before any physics.

Row by row first (readings that are none, temperatures, labels, units), then against the nominal
machine (where the readings stand), then against a fit (what is left). What is certain is mended for
the analysis and said; nothing is changed in the files.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from calib.arrays import Array
from calib.look.clock import clock
from calib.look.conventions import check_conventions, check_lengths
from calib.look.digits import rounding
from calib.look.held import held_actuator
from calib.look.labels import any_labels, mirrored_table, other_labels
from calib.look.load import load_and_payload
from calib.look.misfit import look_at_misfit
from calib.look.moved import moved_station, parts_of
from calib.look.places import Places, places_of, points_of_one, roughly_known
from calib.look.point_units import point_units
from calib.look.pose_labels import pose_labels, shared_labels
from calib.look.proposal import Proposal
from calib.look.refined import refined
from calib.look.repeats import no_measurements
from calib.look.rewritten import rewritten
from calib.look.rewritten_commands import rewritten_commands
from calib.look.rivals import bears_out, better_story, with_fit
from calib.look.seats import displaced_seat
from calib.look.sigmas import in_um, sigmas
from calib.look.slid import check_columns, slid_rows
from calib.look.slid_commands import slid_commands
from calib.look.story import Story
from calib.look.table_frames import framed_table
from calib.look.tables import turned_table
from calib.look.temperatures import temperatures
from calib.look.travel import check_travel
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark
from calib.runs.stack import Rows, stack

_Look = Callable[[Run], tuple[Run, list[Remark]]]
_Hypothesis = Callable[[Places], Proposal | None]
HYPOTHESES: tuple[_Hypothesis, ...] = (
    other_labels, rewritten, displaced_seat, turned_table, framed_table, moved_station,
    mirrored_table, any_labels, slid_rows, held_actuator, rewritten_commands,
)  # fmt: skip
"""What may explain readings that stand in no nest; the first that explains all is taken."""
OF_COLUMNS: tuple[_Look, ...] = (clock, temperatures, load_and_payload)
"""What can be asked of readings of any kind."""
OF_TABLES = tuple(one for one in HYPOTHESES if one is not moved_station)
"""What may make a machine seem off as a whole; a moved station is no other than such a machine."""
NEARLY = 0.9
"""Part of the readings that one of these must then explain by the tolerances alone."""
ONCE_MORE = {"station-moved", "smr-size", "range-step"}
"""What a fit says in place of the one step of the frame that the nominal machine showed."""
NOWHERE = 0.5
"""Part of the readings that stand in their nests, below which commands may be another row's."""
MOST_ROUNDS = 4
"""Hypotheses about places that may hold at once."""
_Known = Mapping[str, Array]


def first_look(machine: Machine, runs: Sequence[Run]) -> Rows:
    """Look at runs and stack them as they are meant.

    Returns
    -------
    Rows
        ``remarks`` says what was found and done, ``known`` which effects the record itself shows.

    Raises
    ------
    BadInput
        For coordinates that are nowhere near the actuators' travel.
    """
    remarks: list[Remark] = _serials(runs)
    looked: list[Run] = []
    known: _Known = {}
    for given in runs:
        check_travel(machine, given)
        points = points_of_one(given)
        run, of_rows = rows_alone(machine, given) if points else _each(given, OF_COLUMNS)
        if not points or roughly_known(run):  # nothing to say of where SMRs stand
            remarks += of_rows
            looked.append(run)
            continue
        check_lengths(machine, run)
        story = _in_units(machine, run, alone=len(runs) == 1)
        parts = [_own_labels(machine, one, given) for one in story.parts]
        told = {one.name for one in story.remarks}
        own = all(one.pose == given.pose for one in parts)
        if "rows-shifted" in told or ("q-rewritten" in told and own):
            # labels were right, q was not
            of_rows = [one for one in of_rows if one.name != "pose-label-shared"]
        remarks += [*of_rows, *story.remarks]
        looked += parts
        known = story.known
    return replace(stack(machine, looked), remarks=tuple(remarks), known=known)


def _own_labels(machine: Machine, run: Run, given: Run) -> Run:
    """The run with the labels it was given, where each is one command once q is put right."""
    if run.pose == given.pose:
        return run
    two = shared_labels(machine, replace(run, pose=given.pose))
    pose = zip(given.pose, run.pose, strict=True)
    return replace(run, pose=tuple(now if own in two else own for own, now in pose))


def _in_units(machine: Machine, run: Run, *, alone: bool) -> Story:
    """The account of a run; with uncertainties in um where that alone makes sense of it."""
    story = _account(machine, run, alone=alone)
    unit = in_um(run)
    if unit is None or any(one.name == unit.remark.name for one in story.remarks):
        return story
    other = with_fit(machine, _account(machine, unit.run, alone=alone))
    if not bears_out(other):
        return story
    return replace(other, remarks=[unit.remark, *other.remarks])


def _account(machine: Machine, run: Run, *, alone: bool) -> Story:
    """What explains where the readings stand: by places, then by a misfit, then by trial."""
    parts, of_places, shown = _places(machine, run)
    if shown and not alone:
        parts, shown = _parted(machine, run), {}
    if len(parts) > 1:
        first = Story(parts, of_places, shown)
    else:
        found = look_at_misfit(machine, parts[0], shown, alone=alone)
        if shown and any(one.name in ONCE_MORE for one in found.remarks):
            of_places = [one for one in of_places if one.name != "station-moved"]
        first = replace(found, remarks=[*of_places, *found.remarks])
    return better_story(machine, run, first, HYPOTHESES, alone=alone)


def _serials(runs: Sequence[Run]) -> list[Remark]:
    """Runs of several machines of one kind, by their controllers' serial numbers."""
    serials = list(dict.fromkeys(r.header.controller_serial for r in runs))
    named = [serial for serial in serials if serial]
    if len(named) < 2:
        return []
    return [
        Remark(
            "several-machines",
            f"The runs are of several machines: serial numbers {', '.join(named)}",
            (),
            "[controller] serial differs from run to run",
            "Fitted together, as if they were one machine",
            "Fit the runs of each machine apart, or correct [controller] serial",
            False,
            runs[0].source,
        )
    ]


def rows_alone(machine: Machine, run: Run) -> tuple[Run, list[Remark]]:
    """What the rows tell by themselves: the run as they are meant, and what is said of it."""
    looked, remarks = no_measurements(run)
    if not looked.measured.any():
        return run, remarks  # the fit says that there is nothing
    looked, found = _each(looked, (*OF_COLUMNS, point_units, rounding, sigmas))
    remarks += found
    for ask in (slid_commands, pose_labels):
        looked, found = ask(machine, looked)
        remarks += found
    return looked, remarks


def _each(run: Run, looks: Sequence[_Look]) -> tuple[Run, list[Remark]]:
    """The run as several looks at it leave it, one after the other."""
    remarks: list[Remark] = []
    for look in looks:
        run, found = look(run)
        remarks += found
    return run, remarks


def _places(machine: Machine, run: Run) -> tuple[list[Run], list[Remark], _Known]:
    """What explains readings that stand where no nest can be, the best hypothesis first."""
    remarks: list[Remark] = []
    for _ in range(MOST_ROUNDS):
        places = places_of(machine, run)
        if places is None:
            check_conventions(machine, run, None)
            break
        check_columns(places)
        if not remarks and places.strict.standing < NOWHERE * places.rows.count:
            run, remarks = slid_commands(machine, run, nowhere=True)
            if remarks:
                continue
        best = _despite_slack(places)
        if best is None:
            if places.rows.count - places.standing < places.limit:
                if not remarks:  # a machine that seems off as a whole may be read otherwise
                    check_conventions(machine, run, places)
                break
            best = _best(places, HYPOTHESES)
            if not remarks:
                check_conventions(machine, run, places, _surely(machine, places, best))
        if best is None:
            break
        meant, remark = best.take()
        meant = refined(machine, run, meant, remark)
        run = meant
        remarks.append(remark)
        if remark.name == "station-moved":
            parts = [run] if best.known else parts_of(places)
            return parts, remarks, best.known
    return [run], remarks, {}


def _despite_slack(places: Places) -> Proposal | None:
    """What explains nearly all by the tolerances alone, where the machine seems off as a whole."""
    strict = places.strict
    if strict is places or strict.standing >= NEARLY * strict.rows.count:
        return None
    best = _best(strict, OF_TABLES)
    return best if best is not None and best.explained >= NEARLY * strict.rows.count else None


def _surely(machine: Machine, places: Places, best: Proposal | None) -> int:
    """How many readings the best proposal explains; none where it does by a wide slack alone.

    A wrong record makes a machine seem off by centimetres; then almost anything explains it.
    """
    if best is None:
        return 0
    if places.strict is places:
        return best.explained
    meant = places_of(machine, best.take()[0])
    stand = 0 if meant is None else meant.strict.standing
    return best.explained if stand >= NOWHERE * places.rows.count else 0


def _best(places: Places, hypotheses: Sequence[_Hypothesis]) -> Proposal | None:
    """The proposal that explains most readings, where it explains clearly more than there stand."""
    best: Proposal | None = None
    for propose in hypotheses:
        if best is not None and best.explained > places.rows.count - places.limit:
            break
        found = propose(places)
        if found is None or found.explained < places.standing + places.limit:
            continue
        if best is None or found.explained > best.explained:
            best = found
    return best


def _parted(machine: Machine, run: Run) -> list[Run]:
    places = places_of(machine, run)
    return [run] if places is None else parts_of(places)
