"""New machine files: a few questions, and a commented file that closes and can be refined."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

from app.machine_templates.questions import Questions


@dataclass(frozen=True)
class Template:
    """A kind of machine and what it is; the module of its name, loaded when asked, writes it."""

    name: str
    says: str

    def render(self, name: str, ask: Questions) -> str:
        """The text of a machine file of that name, from what the answers say."""
        home = import_module(f"app.machine_templates.{self.name}")
        written: Callable[[str, Questions], str] = getattr(home, f"{self.name}_file")
        return written(name, ask)


TEMPLATES: Sequence[Template] = (
    Template("hexapod", "six legs that grow (6-UPS, a Stewart platform)"),
    Template("delta", "three carriages on towers with two rods each"),
    Template("arm", "a serial arm with six axes"),
    Template("linuxcnc", "six struts as LinuxCNC's genhexkins has them"),
    Template("own", "equal limbs around a circle, with joints of your own"),
)

__all__ = ["TEMPLATES", "Questions", "Template"]
