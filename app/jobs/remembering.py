"""What enters the history: fits where they are made, verifications where they are found."""

from collections.abc import Sequence
from pathlib import Path

from app.session.within import session_of
from calib.errors import BadInput
from calib.identify import Fit, fit_report


def remember_fit(fit: Fit, runs: Sequence[str]) -> None:
    """Enter a fit in the history beside the sessions of its runs; other runs have none.

    A medium that cannot be written to keeps no history; the fit stands all the same.
    """
    sessions = [session for session in map(session_of, runs) if session is not None]
    if not sessions:
        return
    from app.history.store import Entry, History, now_utc
    from app.session.taken import taken_in

    header = fit.model.rows.runs[-1].header
    used = header.compensation
    report = fit_report(fit)
    names = ", ".join(session.name for session in sessions)
    said = {
        "runs": [session.name for session in sessions],
        "effects": report["effects"],
        "rms_um": report["rms_um"],
        "holdout_rms_um": report["holdout_rms_um"],
        "chi2_per_dof": report["chi2_per_dof"],
        "parameters": [
            {**one, "value": one["value"] + used.get(one["name"], 0.0)}
            for one in report["parameters"]
            if not one["name"].startswith("frame")
        ],
    }
    when = taken_in(sessions[-1]).ended or now_utc()
    source = " + ".join((names, *report["effects"]))
    entry = Entry("fit", when, fit.model.machine.name, header.controller_serial, source, said)
    try:
        History(sessions[-1].parent).add(entry)
    except BadInput:
        return


def remember_verifications(root: Path) -> None:
    """Enter the finished verifications of a folder that are not in the history yet."""
    from app.history.store import Entry, History
    from app.session.facts import sessions_under
    from app.verification import judge_session

    history = History(root)
    known = {entry.source for entry in history.entries("verification")}
    for facts in sessions_under(root):
        if facts.purpose != "verify" or facts.state != "finished" or facts.folder.name in known:
            continue
        try:
            found = judge_session(facts.folder).to_json()
        except BadInput:
            continue  # too little was read to judge
        said = {key: found[key] for key in ("poses", "measured", "noise_alone", "expanded")}
        history.add(
            Entry(
                "verification", facts.finished_utc, facts.machine, facts.serial, facts.folder.name,
                said,
            )
        )  # fmt: skip
