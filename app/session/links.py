"""Opens the devices of a site, whatever kinds they are."""

from typing import cast

from app.devices import kind_named
from app.files.site import Site
from drivers.interface import MotionController, Tracker
from drivers.kind import ActuatorFacts, Surroundings


async def open_controller(site: Site) -> MotionController:
    """Connect to the site's motion controller; raises a DeviceError if it does not answer."""
    kind = kind_named("controller", site.controller.kind)
    return cast(MotionController, await kind.open(_around(site, "controller")))


async def open_tracker(site: Site) -> Tracker:
    """Connect to the site's tracker; raises a DeviceError if it does not answer."""
    kind = kind_named("tracker", site.tracker.kind)
    return cast(Tracker, await kind.open(_around(site, "tracker")))


def _around(site: Site, role: str) -> Surroundings:
    machine = site.machine
    own = site.controller if role == "controller" else site.tracker
    return Surroundings(
        settings=own.settings,
        serial=own.serial,
        machine=machine.name,
        actuators=tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in machine.actuators),
        parameters={parameter.name: parameter.nominal for parameter in machine.parameters},
        time_scale=site.clock_scale,
        description=machine,
    )
