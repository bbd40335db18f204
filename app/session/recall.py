"""What a session that goes on knows from its journal."""

import numpy as np

from app.session.events import FrameFound
from app.session.kinds import DRIFT
from app.session.rows import PLANNED
from app.session.work import Work
from calib.frames import fit_frame


def recall(work: Work) -> None:
    """Fill the memory from the journal: where the base is, and whether that is to be checked.

    Where the machine stands is not taken from the journal: the controller is asked at connect.
    """
    memory = work.memory
    states = work.journal.states()
    found = any(
        states.get(step.id, PLANNED).state == "done"
        for step in work.plan.steps
        if step.kind is DRIFT
    )
    last = work.last_references()
    if found and len(last) >= 3:
        drawn = np.array([work.site.base_nests[nest] for nest in last]).T
        memory.frame, rms = fit_frame(drawn, np.array(list(last.values())).T)
        memory.frame_found = True
        memory.base = FrameFound(memory.frame.numbers(), rms, tuple(last))
    memory.verified = work.journal.readings() == 0
