"""``python -m app`` is ``pkmcal``."""

import runpy

from app.again import WAY_IN

runpy.run_path(str(WAY_IN), run_name="__main__")
