"""Dialogs. Each shows the stop key, which works in all of them, and can be left with escape."""

from collections.abc import Callable, Sequence
from typing import ClassVar, TypeVar

from textual import on
from textual.app import ComposeResult
from textual.await_complete import AwaitComplete
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.events import Key
from textual.screen import ModalScreen
from textual.widgets import Button, Input, OptionList, Static
from textual.widgets.option_list import Option

from app.session.events import PromptNeeded
from app.tui.widgets.frame import STOP_KEY

_Answer = TypeVar("_Answer")
ROW = 64
"""Columns that a dialog has for a row of buttons."""


class Dialog(ModalScreen[_Answer | None]):
    """The frame of all dialogs."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss(None)", "Close", tooltip="Close without an answer")
    ]
    escape_says: ClassVar[str] = "esc closes"

    def __init__(self, title: str) -> None:
        super().__init__()
        self._title = title
        self._was_left = False

    def dismiss(self, result: _Answer | None = None) -> AwaitComplete:
        """Close with an answer, once: keys that were pressed after it close nothing else."""
        if self._was_left:
            return AwaitComplete()
        self._was_left = True
        return super().dismiss(result)

    def compose(self) -> ComposeResult:
        """The body, and the line that names the stop key."""
        with Vertical(classes="dialog") as box:
            box.border_title = self._title
            yield from self.body()
            with Horizontal(classes="dialog-foot"):
                yield Static(self.escape_says, classes="dialog-escape")
                yield Static(f"[@click=app.stop_all] STOP {STOP_KEY} [/]", classes="dialog-stop")

    def body(self) -> ComposeResult:
        """Give the dialog's own widgets."""
        yield from ()


def choice_keys(choices: Sequence[str]) -> dict[str, str]:
    """Give each choice a key: the first letter of its own that no other has taken."""
    keys: dict[str, str] = {}
    for choice in choices:
        letters = [*choice.lower(), *"123456789"]
        key = next(letter for letter in letters if letter.isalnum() and letter not in keys)
        keys[key] = choice
    return keys


class Choose(Dialog[str]):
    """A question with a few answers; each has a letter, arrows and enter work as well."""

    def __init__(
        self, title: str, text: str, choices: Sequence[str], *, first: str | None = ""
    ) -> None:
        super().__init__(title)
        self._text = text
        self._keys = choice_keys(choices)
        self._first = next(iter(choices)) if first == "" else first

    def body(self) -> ComposeResult:
        """The question and a button for each answer."""
        with VerticalScroll(classes="dialog-text", can_focus=False):
            yield Static(Content(self._text))
        with Horizontal(classes="dialog-buttons"):
            for key, choice in self._keys.items():
                label = Content.from_markup("[bold]$key[/]  $choice", key=key, choice=choice)
                yield Button(label, name=choice)

    def on_mount(self) -> None:
        """Put the focus on the proposed answer, if any is proposed."""
        for button in self.query(Button):
            if button.name == self._first:
                button.focus()

    def on_key(self, event: Key) -> None:
        """Take a letter for an answer; arrows move between the answers."""
        if event.key in self._keys:
            event.stop()
            self.dismiss(self._keys[event.key])
        elif event.key in ("right", "down"):
            self.focus_next(Button)
        elif event.key in ("left", "up"):
            self.focus_previous(Button)

    @on(Button.Pressed)
    def _chosen(self, event: Button.Pressed) -> None:
        self.dismiss(event.button.name)


class Ask(Choose):
    """The session's question. Escape lets the operator look first; the question stays.

    It opens by itself, perhaps under a key that is just being pressed: where the question proposes
    no answer, none is under Enter.
    """

    AUTO_FOCUS: ClassVar[str | None] = ""
    escape_says: ClassVar[str] = "esc: look at the screen first, r comes back here"

    def __init__(self, prompt: PromptNeeded, asked_still: Callable[[], bool]) -> None:
        super().__init__("The job asks you", prompt.text, prompt.choices, first=prompt.default)
        self._asked_still = asked_still
        self._typed = prompt.typed

    def body(self) -> ComposeResult:
        """The question, its answers, and a line where it may be answered in other words."""
        yield from super().body()
        if self._typed:
            yield Input(placeholder=self._typed)

    @on(Input.Submitted)
    def _entered(self, event: Input.Submitted) -> None:
        if event.value.strip():
            self.dismiss(event.value.strip())

    def on_mount(self) -> None:
        """Close by itself when somebody else has answered, or the job has ended."""
        self.set_interval(0.1, self._look)

    def _look(self) -> None:
        if self.is_active and not self._asked_still():
            self.dismiss(None)


class AskOfMany(Ask):
    """A question of the job with more answers than buttons have room: a list, each with a number.

    Nothing is marked until the operator moves into the list.
    """

    def __init__(self, prompt: PromptNeeded, asked_still: Callable[[], bool]) -> None:
        super().__init__(prompt, asked_still)
        self._choices = prompt.choices

    def body(self) -> ComposeResult:
        """The question, the answers below each other, and a line for other words."""
        with VerticalScroll(classes="dialog-text", can_focus=False):
            yield Static(Content(self._text))
        says = [f"{number}  {one}" for number, one in enumerate(self._choices, start=1)]
        yield OptionList(
            *(Option(Content(text), id=one) for text, one in zip(says, self._choices, strict=True))
        )
        if self._typed:
            yield Input(placeholder=self._typed)

    def on_key(self, event: Key) -> None:
        """Take a number for an answer; arrows move into the list."""
        listed = self.query_one(OptionList)
        if event.key.isdigit() and 1 <= int(event.key) <= len(self._choices):
            event.stop()
            self.dismiss(self._choices[int(event.key) - 1])
        elif event.key in ("down", "up") and self.focused is not listed:
            listed.focus()
            listed.highlighted = 0

    @on(OptionList.OptionSelected)
    def _picked(self, event: OptionList.OptionSelected) -> None:
        self.dismiss(event.option.id)


def question(prompt: PromptNeeded, asked_still: Callable[[], bool]) -> Ask:
    """The dialog for a question: buttons in a row, or a list where they have no room."""
    room = sum(len(choice) + 9 for choice in prompt.choices)
    return (Ask if room <= ROW else AskOfMany)(prompt, asked_still)


class Enter(Dialog[str]):
    """One line of text."""

    def __init__(self, title: str, text: str, value: str = "", placeholder: str = "") -> None:
        super().__init__(title)
        self._text = text
        self._value = value
        self._placeholder = placeholder

    def body(self) -> ComposeResult:
        """What is asked, and the line."""
        yield Static(Content(self._text), classes="dialog-text")
        yield Input(self._value, placeholder=self._placeholder)

    @on(Input.Submitted)
    def _entered(self, event: Input.Submitted) -> None:
        if event.value.strip():
            self.dismiss(event.value.strip())


class Pick(Dialog[str]):
    """One of many, from a list; enter takes it."""

    def __init__(self, title: str, text: str, options: Sequence[tuple[str, str]]) -> None:
        super().__init__(title)
        self._text = text
        self._options = options

    def body(self) -> ComposeResult:
        """What is asked, and the list."""
        yield Static(Content(self._text), classes="dialog-text")
        yield OptionList(*(Option(Content(says), id=key) for key, says in self._options))

    def on_mount(self) -> None:
        """Propose the first."""
        self.query_one(OptionList).highlighted = 0

    @on(OptionList.OptionSelected)
    def _picked(self, event: OptionList.OptionSelected) -> None:
        self.dismiss(event.option.id)


class Help(Dialog[None]):
    """What this screen is for, and every key that works on it."""

    def __init__(self, title: str, about: str, keys: Sequence[tuple[str, str, str]]) -> None:
        super().__init__(title)
        self._about = about
        self._keys = keys

    def body(self) -> ComposeResult:
        """A paragraph and a table of keys."""
        width = max(len(key) for key, _, _ in self._keys)
        second = max(len(what) for _, what, _ in self._keys)
        lines = []
        for key, what, why in self._keys:
            line = Content.assemble((f"{key:>{width}}", "bold $ink-accent"), f"  {what:<{second}}")
            lines.append(Content.assemble(line, (f"  {why}", "dim")))
        with VerticalScroll(classes="dialog-help"):
            yield Static(Content(self._about + "\n"))
            yield Static(Content("\n").join(lines))
