"""What a session that goes on knows from its journal."""

import numpy as np

from app.session.work import Work
from calib.frames import fit_frame


def recall(work: Work) -> None:
    """Fill the memory from the journal: where SMRs are, where the base is, what is to be checked.

    Where the machine stands is not taken from the journal: the controller is asked at connect.
    """
    memory = work.memory
    memory.smr_in = {int(smr): nest for smr, nest in work.journal.meta("smrs", {}).items()}
    rows = [row for row in work.journal.rows() if row.kind == "reading"]
    for row in rows:
        if row.nest in work.site.base_nests and row.xyz is not None:
            memory.first_reference.setdefault(row.nest, row.xyz)
            memory.last_reference[row.nest] = row.xyz
    found = any(
        work.journal_state(step.id) == "done" for step in work.plan.steps if step.kind == "drift"
    )
    nests = list(memory.last_reference)
    if found and len(nests) >= 3:
        drawn = np.array([work.site.base_nests[nest] for nest in nests]).T
        seen = np.array([memory.last_reference[nest] for nest in nests]).T
        memory.frame, _ = fit_frame(drawn, seen)
        memory.frame_found = True
    memory.verified = not rows
