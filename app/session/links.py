"""Which driver speaks to which kind of device of the site file."""

from app.site import Site
from drivers.canopen.controller import CanopenController
from drivers.emscon.tracker import EmsconTracker
from drivers.interface import MotionController, Tracker


async def open_controller(site: Site) -> MotionController:
    """Connect to the site's motion controller; raises a DeviceError if it does not answer."""
    settings = site.controller.settings
    return await CanopenController.connect(
        settings["interface"],
        settings["channel"],
        settings["bitrate"] or None,
        machine=site.machine.name,
        node_id=settings["controller_node"],
        serial=site.controller.serial or None,
        limits={a.name: a.limits for a in site.machine.actuators},
    )


async def open_tracker(site: Site) -> Tracker:
    """Connect to the site's tracker; raises a DeviceError if it does not answer."""
    return await EmsconTracker.connect(
        f"{site.tracker.host}:{site.tracker.port}", time_scale=site.clock_scale
    )
