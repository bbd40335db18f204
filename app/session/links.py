"""Opens the devices of a site, whatever kinds they are."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from app.clock import Clock
from app.devices import kind_named
from app.files.site import Site
from app.hosted.controller import HostedController
from app.hosted.means import ByMotors, ByPoses
from app.hosted.store import HostStore, usual_folder
from calib.effects.struts import struts_of
from calib.errors import BadInput
from drivers.interface import Gauge, MotionController, Motors, PoseMover, Tracker
from drivers.kind import ActuatorFacts, Kind, Setting, Strut, Surroundings


async def open_controller(site: Site) -> MotionController:
    """Connect to the site's motion controller.

    One that holds no parameters becomes one: the host computes its motion.

    Raises
    ------
    BadInput
        If a file that the site file names is not there.
    DeviceError
        If it does not answer.
    GateRefused
        If another process owns the host's parameters.
    """
    kind = kind_named("controller", site.controller.kind)
    device = await kind.open(_around(site, "controller", kind))
    if kind.takes == "parameters":
        return cast(MotionController, device)
    means = (
        ByMotors(cast(Motors, device), site.machine)
        if kind.takes == "actuators"
        else ByPoses(cast(PoseMover, device), site.machine)
    )
    try:
        return hosted(site, means)
    except BaseException:
        await device.close()
        raise


def hosted(site: Site, means: ByMotors | ByPoses) -> HostedController:
    """A controller of a device that is open, with the parameters in the site's host store."""
    said = site.controller.store
    folder = Path(said) if said else usual_folder(site.machine, means.device.identity)
    store = HostStore(folder, site.machine)
    store.open()
    try:
        return HostedController(site.machine, means, store, site.load, Clock(site.clock_scale).now)
    except BaseException:
        store.close()
        raise


async def open_tracker(site: Site) -> Tracker:
    """Connect to the site's tracker; raises a DeviceError if it does not answer."""
    kind = kind_named("tracker", site.tracker.kind)
    return cast(Tracker, await kind.open(_around(site, "tracker", kind)))


async def open_gauge(site: Site) -> Gauge:
    """Connect to the site's gauge; raises a DeviceError if it does not answer."""
    kind = kind_named("gauge", site.measured_by.kind)
    return cast(Gauge, await kind.open(_around(site, "gauge", kind)))


def _around(site: Site, role: str, kind: Kind[Any]) -> Surroundings:
    machine = site.machine
    own = site.controller if role == "controller" else site.measured_by
    for setting in kind.settings:
        if setting.form in ("file", "files"):
            _require_files(own.settings[setting.name], role, setting)
    return Surroundings(
        settings=own.settings,
        serial=own.serial,
        machine=machine.name,
        actuators=tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in machine.actuators),
        parameters={parameter.name: parameter.nominal for parameter in machine.parameters},
        time_scale=site.clock_scale,
        description=machine,
        struts=tuple(Strut(**vars(strut)) for strut in struts_of(machine)),
    )


def _require_files(named: str | Sequence[str], role: str, setting: Setting) -> None:
    """Refuse a file that is not there before anything is connected."""
    for path in [named] if isinstance(named, str) else named:
        if path and not Path(path).is_file():
            raise BadInput(
                f"there is no file {path}",
                place=f"site file, [{role}] {setting.name}",
                remedy=f"Correct the path; it is: {setting.says}",
            )
