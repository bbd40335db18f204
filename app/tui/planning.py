"""From what the operator wishes to measure to the plan: poses chosen or read, steps expanded."""

import asyncio
import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.content import Content
from textual.widgets import Button, Checkbox, Input, RadioButton, RadioSet, Static

from app.defaults import FEWEST_FIRST, MOST_FIRST
from app.files.pose_table import Pose, read_poses
from app.files.poses import full_poses, read_pose_file
from app.files.site import Site
from app.jobs.measuring import marks_of
from app.jobs.read_there import drawn_for, readings_of
from app.session.plan import Plan
from app.session.plans import Order, PlanOptions, measure_plan
from app.tui.automatic import FlightWish
from app.tui.browsing import Browse
from app.tui.choosing import IS_POSES
from app.tui.dialogs import Dialog
from calib.poses import design_poses
from calib.poses.margin import stroke_margin

SEED = 1


@dataclass(frozen=True)
class RunWish:
    """What to measure: ``poses`` is a number of poses to choose, or the path of a poses file."""

    poses: str
    order: Order
    warm_up: bool


async def plan_for(site: Site, wish: RunWish) -> Plan:
    """Choose or read the poses and expand the plan; raises :class:`BadInput`."""
    poses = await _poses(site, wish.poses)
    marks = () if wish.poses.isdigit() else marks_of((), wish.poses, site)
    options = PlanOptions(order=wish.order, warm_up=wish.warm_up, marks=marks)
    return measure_plan(site, poses, options)


async def _poses(site: Site, wish: str) -> dict[str, Pose]:
    if wish.isdigit():
        # A second of arithmetic: beside the event loop, so that the stop key stays alive.
        return await asyncio.to_thread(_choose, site, int(wish))
    path = Path(wish)
    if path.suffix == ".csv":
        return read_poses(path)
    return read_pose_file(path, site.machine).by_label


def _choose(site: Site, count: int) -> dict[str, Pose]:
    margin = stroke_margin(site.machine, site.limits.margin_mm)
    design = design_poses(
        site.machine, readings_of(site.machine, site, False, None, None), count,
        np.random.default_rng(SEED), counts=(), margin=margin, draw=drawn_for(site, margin),
    )  # fmt: skip
    return full_poses(design.labels, design.pose_set)


class Radio(RadioButton):
    """A choice that shows by its sign, not only by its colour, whether it is taken."""

    @property
    def BUTTON_INNER(self) -> str:  # type: ignore[override]  # noqa: N802 - Textual's own name
        """The sign between the brackets."""
        return "●" if self.value else " "


class Check(Checkbox):
    """A box that is empty when it is not ticked."""

    @property
    def BUTTON_INNER(self) -> str:  # type: ignore[override]  # noqa: N802 - Textual's own name
        """The sign between the brackets."""
        return "X" if self.value else " "


def is_poses_file(path: Path) -> bool:
    """Whether it is a poses file of the program, or a table that may hold poses."""
    return path.suffix == ".csv" or IS_POSES(path)


class NewRun(Dialog[RunWish]):
    """The form for a new run."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("ctrl+o", "look", "Poses file", priority=True)]
    escape_says: ClassVar[str] = "tab: next field   enter: start   esc: close"

    def __init__(self, site: Site) -> None:
        super().__init__("New run")
        self._enough = site.hands.smrs >= len(site.platform_nests)
        self._nests = len(site.platform_nests)
        self._gauge = site.gauge

    def body(self) -> ComposeResult:
        """Poses, order, warm-up, start."""
        yield Static(
            Content("How many poses (the most telling are chosen), or a poses file:"),
            classes="form-label",
        )
        yield Input("29", id="poses", compact=True)
        yield Static(Content("Order:"), classes="form-label")
        first, second = (
            (
                "nest by nest: one SMR is carried, all poses with each nest",
                f"pose by pose: an SMR in each of the {self._nests} nests",
            )
            if self._gauge is None
            else ("pair by pair, or place by place", "pose by pose: all pairs of nests at each")
        )
        by_pose = self._enough and self._gauge is None
        with RadioSet(id="order", compact=True):
            yield Radio(first, value=not by_pose)
            yield Radio(second, value=by_pose)
        yield Check("wait until temperatures are steady", True, id="warm-up", compact=True)
        with Horizontal(classes="dialog-buttons"):
            yield Button("Start", variant="success", id="start")
            yield Button("Poses file  ctrl+o", id="look")

    @on(Button.Pressed, "#look")
    def action_look(self) -> None:
        """Look for a poses file in the folders; it takes the place of the number."""

        def taken(path: str | None) -> None:
            if path:
                self.query_one("#poses", Input).value = path

        text = "Open folders down to the poses file (.toml or .csv), and take it"
        self.app.push_screen(Browse("Poses file", text, Path(), is_poses_file), taken)

    @on(Input.Submitted)
    @on(Button.Pressed, "#start")
    def _start(self) -> None:
        poses = self.query_one("#poses", Input).value.strip()
        if not poses:
            self.notify("Give a number of poses, or the path of a poses file.")
            return
        pressed = self.query_one("#order", RadioSet).pressed_index
        order: Order = "pose-by-pose" if pressed == 1 else "nest-by-nest"
        self.dismiss(RunWish(poses, order, self.query_one("#warm-up", Checkbox).value))


class NewFlight(Dialog[FlightWish]):
    """The form for the autopilot."""

    escape_says: ClassVar[str] = "tab: next field   enter: start   esc: close"

    def __init__(self) -> None:
        super().__init__("Decide by itself")

    def body(self) -> ComposeResult:
        """Target, time, first set, writing, start."""
        for name, value, says in (
            ("target", "8", "RMS position error at fresh poses that is wanted, µm:"),
            ("hours", "", "Hours of machine time in all (empty: no limit):"),
            ("first", "15", f"Poses to begin with, {FEWEST_FIRST} to {MOST_FIRST}:"),
        ):
            yield Static(Content(says), classes="form-label")
            yield Input(value, id=name, compact=True)
        yield Check("write to the machine what passes every gate", True, id="write", compact=True)
        with Horizontal(classes="dialog-buttons"):
            yield Button("Start", variant="success", id="start")

    @on(Input.Submitted)
    @on(Button.Pressed)
    def _start(self) -> None:
        texts = {name: self.query_one(f"#{name}", Input).value for name in ("target", "hours")}
        hours = texts["hours"].strip()
        target = positive(texts["target"])
        if target is None or (hours and positive(hours) is None):
            self.notify("Give the target, and hours if there is a limit, as positive numbers.")
            return
        first = self.query_one("#first", Input).value.strip()
        if not first.isdigit() or not FEWEST_FIRST <= int(first) <= MOST_FIRST:
            self.notify(f"Begin with {FEWEST_FIRST} to {MOST_FIRST} poses.")
            return
        apply = self.query_one("#write", Checkbox).value
        self.dismiss(FlightWish(target, positive(hours), int(first), apply))


def positive(text: str) -> float | None:
    """A positive number that was typed; None if it is none."""
    try:
        value = float(text.strip().replace(",", "."))
    except ValueError:
        return None
    return value if 0.0 < value < math.inf else None
