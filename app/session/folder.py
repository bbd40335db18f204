"""A session on disk: site, plan and journal in one folder, there as a whole or not at all."""

from datetime import UTC, datetime
from pathlib import Path

from app.files.site import Site, parse_site
from app.files.text import read_text
from app.session.journal import Journal
from app.session.plan import Plan
from app.session.within import JOURNAL, PLAN
from calib.errors import BadInput

SITE, RUN = "site.toml", "run"
_DRAFT = "draft-"


def make_folder(root: Path, site: Site, plan: Plan) -> Path:
    """Make the folder of a new session under ``root``, named by the time of day.

    It is made under another name and renamed when it is complete, so that a process killed
    meanwhile leaves no half session.
    """
    stamp = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    name = f"{stamp}-{site.machine.name}-{plan.purpose}"
    draft = _fresh(root, f"{_DRAFT}{name}")
    (draft / SITE).write_text(site.to_toml(), encoding="utf-8")
    (draft / PLAN).write_text(plan.to_json(), encoding="utf-8")
    journal = Journal(draft / JOURNAL)
    journal.enter_plan(plan)
    journal.set_meta("begun_utc", datetime.now(UTC).isoformat(timespec="seconds"))
    journal.close()
    while True:
        folder = _fresh(root, name)
        folder.rmdir()
        try:
            return draft.rename(folder)
        except FileExistsError:  # another process was faster
            continue


def read_folder(folder: Path) -> tuple[Site, Plan]:
    """Read site and plan of a session; raises :class:`BadInput` if the folder holds none."""
    for name in (PLAN, SITE, JOURNAL):
        if not (folder / name).is_file():
            raise BadInput(f"no {name} here", place=str(folder), remedy="Name a session's folder")
    plan = Plan.from_json(read_text(folder / PLAN), str(folder / PLAN))
    site = parse_site(read_text(folder / SITE), str(folder / SITE), folder)
    return site, plan


def latest_session(root: Path) -> Path:
    """The newest session under ``root``; raises :class:`BadInput` if there is none."""
    found = sorted(
        path.parent for path in root.glob(f"*/{JOURNAL}") if not path.parent.name.startswith(_DRAFT)
    )
    if not found:
        raise BadInput("no session here", place=str(root), remedy="Name the session's folder")
    return found[-1]


def _fresh(root: Path, name: str) -> Path:
    """Make an empty folder ``name``, or ``name-2`` .. where it exists."""
    for suffix in ("", *(f"-{number}" for number in range(2, 100))):
        folder = root / f"{name}{suffix}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        return folder
    raise BadInput(
        "a hundred sessions in one second", place=str(root), remedy="Begin the next one later"
    )
