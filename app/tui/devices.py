"""Devices: open a site or start a mock, connect, see what the devices say of themselves."""

from pathlib import Path
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.widgets import Static

from app.files.site import Site
from app.session.events import Connected
from app.session.facts import SessionFacts, sessions_under
from app.tui.choosing import IS_SITE, choose_file, here
from app.tui.dialogs import Choose, Enter
from app.tui.face import Face
from app.tui.next_step import job_steps
from app.tui.picture import Picture
from app.tui.starting import MYSTERY, start_text
from app.tui.wording import channel_text
from drivers.interface import ActuatorState, ControllerState, GaugeState, TrackerState

RECENT = 3
"""Sessions on the empty screen."""


MEASURES = {"tracker": "Laser tracker", "gauge": "Gauge"}
"""Head of the panel of what measures."""


class DevicesFace(Face):
    """The first screen."""

    mode = "devices"
    label = "Devices"
    about = (
        "Open the site file of your lab (o), or start a mock machine to practise on (m). Then "
        "connect (c): the devices' identities are compared with the site file. Nothing moves "
        "on this screen."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("o", "open_site", "Site", tooltip="Choose or type the site file"),
        Binding("m", "mock", "Mock", tooltip="Start a mock machine with its tracker"),
        Binding("c", "connect", "Connect", tooltip="Connect to the devices, or let them go"),
        Binding("e", "power", "Drives", tooltip="Switch the drives' power"),
        Binding(
            "a",
            "app.show_side('watch')",
            "Watch",
            show=False,
            tooltip="Watch a session that another terminal runs, read-only",
        ),
        Binding(
            "t", "try", "Try", show=False, tooltip="Look at the mystery run: what is wrong with it?"
        ),
        Binding(
            "h",
            "app.show_side('history')",
            "History",
            tooltip="What became of this machine: sets, fits, verifications, drifts",
        ),
        Binding("f", "clear_faults", "Reset", tooltip="Reset standing drive faults"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._recent: list[SessionFacts] | None = None
        self._mock_line = "hexapod --seed 7 --scale 20"

    def body(self) -> ComposeResult:
        """Site, controller and tracker; alarms beside or below them."""
        with Horizontal(id="devices"):
            with VerticalScroll(id="devices-state", can_focus=False):
                yield Static(id="dev-site", classes="panel")
                yield Static(id="dev-controller", classes="panel")
                yield Static(id="dev-tracker", classes="panel")
            with Vertical(id="devices-alarms"):
                yield Static(id="dev-alarms", classes="panel")

    def on_mount(self) -> None:
        """Name the panels."""
        for name, title in (
            ("site", "Site"), ("controller", "Motion controller"),
            ("tracker", "Laser tracker"), ("alarms", "Alarms"),
        ):  # fmt: skip
            self.query_one(f"#dev-{name}").border_title = title

    def show(self, picture: Picture) -> None:
        """Draw all panels."""
        states, links = picture.states, picture.connected
        self._put("site", self._site_text())
        self._put(
            "controller",
            controller_text(links.get("controller"), states.controller if states else None),
        )
        role = self._measures()
        self.query_one("#dev-tracker").border_title = MEASURES[role]
        if role == "gauge":
            gauge = gauge_text(links.get(role), states.gauge if states else None)
            self._put("tracker", gauge)
        else:
            state = states.tracker if states else None
            self._put("tracker", tracker_text(links.get(role), state))
        self._put("alarms", alarms_text(picture, 1 if self.low else 30))
        for panel, name in (("controller", "controller"), ("tracker", role)):
            link = links.get(name)
            self.query_one(f"#dev-{panel}").border_subtitle = link.address if link else ""

    def _measures(self) -> str:
        site = self.desk.site
        return "gauge" if site is not None and site.gauge is not None else "tracker"

    def _site_text(self) -> Content:
        if self.desk.site is not None:
            return site_text(self.desk.site, self.desk.mock is not None)
        if self._recent is None:
            self._recent = sessions_under(self.desk.root, RECENT)
        return start_text(job_steps(self.desk), self._recent)

    def _put(self, panel: str, text: Content) -> None:
        self.query_one(f"#dev-{panel}", Static).update(text)

    # keys

    def action_open_site(self) -> None:
        """Choose among the site files here, or another one."""

        def opened(path: Path) -> None:
            self.act(lambda: self.desk.open_site(path))

        choose_file(self, "Open site", here(Path(), IS_SITE), IS_SITE, opened, "site file")

    def action_mock(self) -> None:
        """Ask for the mock's arguments and start it."""
        text = (
            "A mock machine with its tracker starts as a process of its own and ends with this "
            "program. Arguments as for pkmcal mock (--effect backlash.leg3=0.015 hides an effect):"
        )

        def entered(answer: str | None) -> None:
            if answer:
                self._mock_line = answer
                arguments = answer.split()
                self.act(lambda: self._start(arguments), busy="starting a mock station ...")

        self.app.push_screen(Enter("Start a mock", text, self._mock_line), entered)

    async def _start(self, arguments: list[str]) -> None:
        await self.desk.start_mock(arguments)
        await self.desk.connect()

    def action_connect(self) -> None:
        """Connect, or let go."""
        if self.desk.connected:
            self.act(self.desk.disconnect)
        else:
            self.act(self.desk.connect, busy="connecting ...")

    async def action_try(self) -> None:
        """Ask what the model of the tutorial's run misses, on the Discover screen."""
        if not MYSTERY.is_dir():
            self.notify("The mystery run comes with a clone of the program, not with this package.")
            return
        study = self.desk.study
        study.choose((str(MYSTERY),))
        self.act(study.diagnose, busy="asking what is missing ...")
        await self.bench.switch_mode("discover")

    def action_clear_faults(self) -> None:
        """Reset drive faults."""
        self.act(self.desk.clear_faults)

    def action_power(self) -> None:
        """Switch the drives; on is asked for, because the machine may twitch."""
        states = self.desk.picture.states
        if states is not None and states.controller is not None and states.controller.enabled:
            self.act(lambda: self.desk.power(False))
            return

        def sure(answer: str | None) -> None:
            if answer == "switch on":
                self.act(lambda: self.desk.power(True))

        self.app.push_screen(
            Choose("Drives on?", "Nobody in the machine? The legs get power and may twitch.",
                   ("switch on", "leave off")),
            sure,
        )  # fmt: skip


def site_text(site: Site, mock: bool) -> Content:
    """Say which site is open."""
    who = "the mock" if site.hands.kind == "mock" else "you"
    smrs = "one SMR" if site.hands.smrs == 1 else f"{site.hands.smrs} SMRs"
    own = "  (started by this program)" if mock else ""
    if site.gauge is not None:
        gauge = site.gauge
        pairs = (
            f"{len(gauge.pairs)} pairs of nests" if gauge.pairs else f"at {gauge.nest or 'marks'}"
        )
        return Content(
            f"{site.title or site.source}{own}   clock x{site.clock_scale:g}\n"
            f"{site.machine.name}; {gauge.name} reads a {gauge.reads}, {pairs}"
            + (f", plane {gauge.plane}" if gauge.plane else "")
        )
    lines = [
        f"{site.title or site.source}{own}   clock x{site.clock_scale:g}",
        f"{site.machine.name}; nests {', '.join(site.platform_nests)}; base "
        f"{', '.join(site.base_nests)}; {smrs}, carried by {who}",
    ]
    return Content("\n".join(lines))


def identity_line(link: Connected | None) -> Content:
    """Say who answers, or that nobody does."""
    if link is None:
        return Content.from_markup("[dim]○ not connected[/]")
    who = link.identity
    # A vendor that is only a number tells the operator nothing beside the product's name.
    vendor = "" if who.product and who.vendor.startswith("0x") else who.vendor
    names = " ".join(part for part in (vendor, who.product) if part) or who.kind
    serial = f"   serial {who.serial}" if who.serial else ""
    firmware = f"   firmware {who.firmware}" if who.firmware else ""
    return Content.from_markup(
        "[$ink-success]●[/] [bold]$names[/]$rest", names=names, rest=serial + firmware
    )


def controller_text(link: Connected | None, state: ControllerState | None) -> Content:
    """Identity, one line for each actuator, channels."""
    lines = [identity_line(link)]
    if link is not None and state is None:
        lines.append(Content("no answer to the last question; see the alarms"))
    if state is not None:
        power = ("drives ON", "bold") if state.enabled else ("drives off", "")
        motion = "moving" if state.moving else "standing"
        channels = channel_text(state.channels)
        lines.append(Content.assemble(power, f", {motion}   {channels}"))
        lines.append(
            Content.from_markup("[dim]actuator     position       target  homed  state[/]")
        )
        lines += [actuator_line(actuator) for actuator in state.actuators]
    return Content("\n").join(lines)


def actuator_line(actuator: ActuatorState) -> Content:
    """One actuator's line."""
    homed = "yes" if actuator.homed else "NO"
    sign = "▶" if actuator.moving else " "
    text = (
        f"{actuator.name:<9}{sign}{actuator.position:>11.4f}  {actuator.target:>11.4f}  "
        f"{homed:<5}  {actuator.state}"
    )
    if actuator.fault:
        return Content.assemble(text, (f"  ✗ {actuator.fault}", "bold $ink-error"))
    return Content(text)


def tracker_text(link: Connected | None, state: TrackerState | None) -> Content:
    """Identity and flags."""
    lines = [identity_line(link)]
    if link is not None and state is None:
        lines.append(Content("no answer to the last question; see the alarms"))
    if state is not None:
        flags = (
            (state.initialized, "initialised", "not initialised"),
            (state.laser_warm, "warm", "cold"),
            (state.ready, "ready", "not ready"),
            (state.locked, "beam locked", "no beam"),
        )
        signs = [
            Content.from_markup("[$ink-success]✓[/] $yes", yes=yes)
            if flag
            else Content.from_markup("[dim]·[/] $no", no=no)  # a job sees to it
            for flag, yes, no in flags
        ]
        signs.append(Content(f"{state.reflector or 'no reflector'}  face {state.face}"))
        lines.append(Content("  ").join(signs))
    return Content("\n").join(lines)


def gauge_text(link: Connected | None, state: GaugeState | None) -> Content:
    """Identity, and what it said last."""
    lines = [identity_line(link)]
    if link is not None and state is None:
        lines.append(Content("no answer to the last question; see the alarms"))
    if state is not None:
        told = "[$ink-success]✓[/] $said" if state.ready else "[$ink-warning]✗ no reading[/]: $said"
        sign = told if state.last else "[dim]·[/] not read yet"
        lines.append(Content.from_markup(sign, said=state.last))
    return Content("\n").join(lines)


def alarms_text(picture: Picture, most: int) -> Content:
    """The latest alarms first."""
    if not picture.alarms:
        return Content.from_markup("[dim]no alarms[/]")
    lines = []
    for time_s, alarm in reversed(list(picture.alarms)[-most:]):
        sign, style = ("✗", "bold $ink-error") if alarm.fault else ("!", "$ink-warning")
        line = Content.assemble(
            (f"{sign} {time_s:.0f} s ", style), (f"{alarm.device}: ", "bold"), alarm.what
        )
        lines.append(Content.assemble(line, f" → {alarm.remedy}") if alarm.remedy else line)
    return Content("\n").join(lines)
