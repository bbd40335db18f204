"""Who answers what a template asks."""

from typing import Protocol


class Questions(Protocol):
    """Who answers: a person at the terminal, or values given beforehand."""

    def number(self, name: str, question: str, default: float) -> float:
        """Ask for a number."""

    def text(self, name: str, question: str, default: str) -> str:
        """Ask for a text."""
