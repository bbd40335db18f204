"""What a record is of: people, item, instruments, conditions, method, what it does not say."""

from collections.abc import Mapping
from typing import Any

from app.files.record_details import RecordDetails
from app.report.accuracy import FOUND, LEFT, Tolerance
from app.report.instruments import by_tracker, other_instruments, taken_words
from app.report.page import Block, Facts, Items, Section, Table, Text
from app.report.sources import Sources
from app.report.words import day, minute, plain
from app.session.taken import Span, Taken
from calib.identify import Fit

SIMULATED = "(mock)"
ROUGHLY = "the places of instruments, nests and planes that are known only roughly"
OF_ERRORS = (
    "Those of errors hold what the tracker states of each reading, carried through the rigid fits "
    "of platform and base; those of parameters hold it together with the tolerances of what the "
    "readings leave open. "
)
OF_PARAMETERS = (
    "Those of parameters hold what is stated of each reading, together with the tolerances of what "
    "the readings leave open. "
)
OF_DRAWING = (
    "Not contained are the places of the nests on platform and base, which are taken from their "
    "drawing."
)
OF_EXACT = "Not contained are the places of nests and planes that are stated as exact."
CHANNELS = {
    "air_temp_C": ("air temperature", "°C", 2),
    "structure_temp_C": ("temperature of the structure", "°C", 2),
    "pressure_hPa": ("air pressure", "hPa", 1),
    "humidity": ("relative humidity", "%", 0),
    "payload_kg": ("payload", "kg", 3),
}


def head_facts(details: RecordDetails, sources: Sources, machine: str, serial: str) -> Facts:
    """What stands under the title."""
    spans = [one for one in _all_taken(sources) if one.begun]
    began = min((one.begun for one in spans), default="")
    ended = max((one.ended for one in spans), default="")
    when = day(began) if day(began) == day(ended) else f"{day(began)} to {day(ended)}"
    return Facts(
        (
            ("Customer", details.customer.strip()),
            ("Item", f"{machine}, serial number {serial}" if serial else machine),
            ("Place", details.place.strip()),
            ("Calibrated by", details.laboratory.strip()),
            ("Operator", details.operator.strip()),
            ("Date of calibration", when if spans else ""),
        )
    )


def _all_taken(sources: Sources) -> list[Taken]:
    checked = [one.taken for one in (sources.before, sources.after) if one is not None]
    return [*sources.measured, *checked]


def instruments_section(details: RecordDetails, sources: Sources, fit: Fit) -> Section:
    """The item and the instruments, with serial numbers and days of their own calibration."""
    header = fit.model.rows.runs[-1].header
    machine = fit.model.rows.machine
    seen: dict[str, Mapping[str, str]] = {}
    for one in _all_taken(sources):
        seen.update(one.identities)
    controller, tracker = seen.get("controller", {}), seen.get("tracker", {})
    gauge = seen.get("gauge", {})
    serial = header.controller_serial or controller.get("serial", "")
    rows = (
        ("Machine", _line(machine.says or machine.name, details.machine_maker)),
        ("Machine, serial number", details.machine_serial),
        ("Controller", _device(controller, serial)),
        ("Laser tracker", _device(tracker, str(header.tracker.get("serial", "")),
                                  str(header.tracker.get("model", "")))),
        ("Laser tracker, calibrated", _calibrated(details.tracker_calibrated,
                                                  details.tracker_certificate)),
        ("Reflector", _line(str(header.tracker.get("reflector", "")),
                            _numbered(details.reflector_serial))),
        ("Reflector, calibrated", details.reflector_calibrated),
        ("Thermometer of the structure", details.thermometer),
        ("Thermometer, calibrated", details.thermometer_calibrated),
        ("Gauge", _device(gauge, "") if gauge.get("serial") else ""),
        ("Instruments", ", ".join(other_instruments(fit))),
        ("Nests", f"platform: {', '.join(header.platform_nests)}; base: "
                  f"{', '.join(header.base_nests) or 'none'}"),
    )  # fmt: skip
    blocks: list[Block] = [Facts(rows)]
    blocks.append(Text(_traceability(details, fit)))
    missing = [
        what
        for what, said in (
            ("customer", details.customer.strip()),
            ("laboratory", details.laboratory.strip()),
            ("place", details.place.strip()),
            ("operator", details.operator.strip()),
            ("the machine's own serial number", details.machine_serial),
            ("the reflector's calibration", details.reflector_calibrated or not by_tracker(fit)),
        )
        if not said
    ]
    if missing:
        listed = ", ".join(missing[:-1]) + " and " * (len(missing) > 1) + missing[-1]
        blocks.append(Text(f"Not stated by the laboratory: {listed}."))
    return Section("Item and instruments", tuple(blocks))


def _traceability(details: RecordDetails, fit: Fit) -> str:
    """Whether lengths go back to the metre, and by which certificate."""
    if not by_tracker(fit):
        named = " and ".join(other_instruments(fit)) or "the instruments"
        return (
            "Metrological traceability is not shown: the laboratory states no certificate of "
            f"{named}."
        )
    if details.tracker_calibrated and details.tracker_certificate:
        return (
            "Lengths are traceable to the metre by the calibration of the laser tracker, "
            f"certificate {details.tracker_certificate}."
        )
    return (
        "Metrological traceability is not shown: the laboratory states no certificate of the "
        "laser tracker."
    )


def _device(identity: Mapping[str, str], serial: str, product: str = "") -> str:
    name = identity.get("product") or product or identity.get("kind", "")
    firmware = identity.get("firmware", "")
    return _line(name, _numbered(identity.get("serial") or serial),
                 f"firmware {firmware}" if firmware else "")  # fmt: skip


def _numbered(serial: str) -> str:
    return f"serial number {serial}" if serial else ""


def _calibrated(on: str, certificate: str) -> str:
    return _line(on, f"certificate {certificate}" if certificate else "")


def _line(*parts: str) -> str:
    return ", ".join(part for part in parts if part)


def conditions_section(sources: Sources) -> Section:
    """When what was measured, and under which conditions."""
    columns = [
        (name, one)
        for name, one in (
            (FOUND, sources.before.taken if sources.before else None),
            *(
                (f"measured, run {k}" if len(sources.measured) > 1 else "measured", one)
                for k, one in enumerate(sources.measured, start=1)
            ),
            (LEFT, sources.after.taken if sources.after else None),
        )
        if one is not None
    ]
    rows: list[tuple[str, ...]] = [
        ("begun", *(minute(one.begun) or "not kept" for _, one in columns)),
        ("ended", *(minute(one.ended) or "not kept" for _, one in columns)),
        ("readings", *(str(one.readings) for _, one in columns)),
    ]
    names = dict.fromkeys(name for _, one in columns for name in one.channels)
    for name in sorted(
        names, key=lambda n: (n not in CHANNELS, list(CHANNELS).index(n) if n in CHANNELS else 0, n)
    ):
        label, unit, digits = CHANNELS.get(name, (name.replace("_", " "), "", 3))
        cells = [_span(one.channels.get(name), digits) for _, one in columns]
        rows.append((f"{label}, {unit}" if unit else label, *cells))
    heads = ("", *(name for name, _ in columns))
    caption = "Lowest to highest as measured with the readings, with the mean in brackets."
    return Section("Times and conditions", (Table(heads, tuple(rows), caption),))


def _span(span: Span | None, digits: int) -> str:
    if span is None:
        return "–"
    low, mean, high = (plain(f"{v:.{digits}f}") for v in (span.low, span.mean, span.high))
    return low if low == high else f"{low} to {high} ({mean})"


def method_section(
    sources: Sources, fit: Fit, answer: Mapping[str, Any], details: RecordDetails,
    tolerance: Tolerance,
) -> Section:  # fmt: skip
    """How it was done, what the uncertainties hold, how conformity is decided."""
    rows = fit.model.rows
    checked, tracked = sources.before or sources.after, by_tracker(fit)
    machine = sum(
        p.name in {r["name"] for r in answer["parameters"]} for p in rows.machine.parameters
    )
    said = [
        *taken_words(fit),
        f"From these readings {machine} parameters of the machine's kinematic model, its effects "
        f"beside the geometry and {'the place of the tracker' if tracked else ROUGHLY} were "
        "identified together, by maximum likelihood with the manufacturing tolerances as prior "
        "knowledge; poses held out of the fit decided what the model may contain.",
    ]
    if checked:
        said.append(
            "As found and as left the machine was sent to poses that no fit has used; at each the "
            "pose of the platform was found from its nests in the base frame that the base nests "
            "give, and compared with the pose that was commanded."
        )
    blocks: list[Block] = [Text(" ".join(said))]
    if details.procedure:
        blocks.append(Text(f"Procedure: {details.procedure}."))
    blocks.append(
        Text(
            "Expanded uncertainties U have the coverage factor k = 2, about 95 %. "
            + (OF_ERRORS if checked else OF_PARAMETERS)
            + (OF_DRAWING if tracked else OF_EXACT)
        )
    )
    if tolerance.um is not None or tolerance.mdeg is not None:
        blocks.append(
            Text(
                "Decision rule: guarded acceptance with the guard band U. PASS is stated where at "
                "every pose the error plus its U is not larger than the tolerance, otherwise FAIL. "
                "A machine on the limit is so passed by mistake in at most about 2.5 % of cases."
            )
        )
    return Section("Method", tuple(blocks))


def statements_section(details: RecordDetails, sources: Sources) -> Section:
    """What the record says of itself."""
    simulated = any(
        SIMULATED in who.get("product", "") or "mock" in who.get("product", "")
        for one in _all_taken(sources)
        for who in one.identities.values()
    )
    items = [
        "The results relate only to the item named above, in the state and under the conditions "
        "stated here.",
        "This record has the content that ISO/IEC 17025 asks of a calibration record. It is not "
        "issued under an accreditation.",
        "It may be copied as a whole only, unless the laboratory agrees in writing.",
    ]
    if simulated:
        items.insert(0, "Controller and instruments were simulated ones: there is no such machine.")
    blocks: list[Block] = [Items(tuple(items))]
    if details.remarks:
        blocks.insert(0, Text(details.remarks.strip()))
    return Section("Statements", tuple(blocks))
