"""What a site file says of a station's LinuxCNC."""

import sys
from typing import Any

from mocks.linuxcnc.program import LinuxCnc


def linuxcnc_site(program: LinuxCnc) -> dict[str, Any]:
    """Table ``[controller]``; ``program`` runs."""
    folder = program.ini.parent
    found: dict[str, Any] = {
        "kind": "linuxcnc",
        "ini": str(program.ini),
        "restart": f"{sys.executable} -m mocks.linuxcnc.restart {folder}",
    }
    if program.env:
        found["env"] = dict(program.env)
    return found
