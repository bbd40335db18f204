"""Sessions with a gauge: begun, run to their end, disturbed in the middle."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from app.files.pose_table import Pose
from app.files.site import Site
from app.session import events as ev
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session

Hear = Callable[[ev.Event], None]


def begun(site: Site, poses: Mapping[str, Pose], folder: Path, *hear: Hear, **kind: Any) -> Session:
    """A session in which nobody is there; ``kind`` are further options of its plan."""
    options = PlanOptions(warm_up=False, **kind)
    session = Session.create(site, measure_plan(site, poses, options), folder, unattended=True)
    for one in hear:
        session.observers.watch(one)
    return session


async def run(session: Session) -> Path:
    """The run folder of a session that has come to its end; it is closed in any case."""
    try:
        return (await session.run()).run_folder
    finally:
        await session.close()


def once_read(count: int, do: Callable[[], Any]) -> Hear:
    """Do something when so many numbers have been taken."""

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.NumberTaken) and event.number == count:
            do()

    return hear
