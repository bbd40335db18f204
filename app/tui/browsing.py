"""Looking for a file in the folders: only what can be taken is shown."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.content import Content
from textual.widgets import DirectoryTree, Static

from app.tui.dialogs import Dialog


class Wanted(DirectoryTree):
    """Folders, and the files that are wanted; what is hidden stays hidden."""

    def __init__(self, root: Path, wanted: Callable[[Path], bool]) -> None:
        super().__init__(root)
        self._wanted = wanted

    def filter_paths(self, paths: Iterable[Path]) -> Iterable[Path]:
        """Leave out every other file."""
        shown = (path for path in paths if not path.name.startswith("."))
        return [path for path in shown if _is_folder(path) or self._wanted(path)]


class Browse(Dialog[str]):
    """A tree of folders; enter opens one, or takes a file. ``up`` goes above where it began."""

    escape_says: ClassVar[str] = "enter: open, take   backspace: up   esc: close"
    BINDINGS = [("backspace", "up", "Above")]  # noqa: RUF012 - Textual's own

    def __init__(self, title: str, text: str, root: Path, wanted: Callable[[Path], bool]) -> None:
        super().__init__(title)
        self._text = text
        self._root = root.resolve()
        self._wanted = wanted

    def body(self) -> ComposeResult:
        """What is looked for, and the tree."""
        yield Static(Content(self._text), classes="dialog-text")
        yield Wanted(self._root, self._wanted)

    def on_mount(self) -> None:
        """The keys belong to the tree."""
        self.query_one(Wanted).focus()

    @on(DirectoryTree.FileSelected)
    def _taken(self, event: DirectoryTree.FileSelected) -> None:
        self.dismiss(str(event.path))

    def action_up(self) -> None:
        """Show the folder above."""
        tree = self.query_one(Wanted)
        tree.path = Path(tree.path).parent


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # somebody else's
        return False
