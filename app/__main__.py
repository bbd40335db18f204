"""``python -m app`` is ``pkmcal``."""

from app.cli import main

main()
