"""Which driver speaks to which kind of device of the site file."""

from app.files.site import Site
from drivers.canopen.controller import CanopenController
from drivers.emscon.tracker import EmsconTracker
from drivers.gcs.axes import Axes
from drivers.gcs.controller import GcsController
from drivers.interface import MotionController, Tracker


async def open_controller(site: Site) -> MotionController:
    """Connect to the site's motion controller; raises a DeviceError if it does not answer."""
    if site.controller.kind == "gcs":
        return await _open_gcs(site)
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


async def _open_gcs(site: Site) -> MotionController:
    settings = site.controller.settings
    names = [actuator.name for actuator in site.machine.actuators]
    return await GcsController.connect(
        settings["channel"],
        settings["baudrate"],
        axes=Axes(dict(zip(names, settings["axes"], strict=True)), settings["pose_axes"]),
        serial=site.controller.serial or None,
        limits={a.name: a.limits for a in site.machine.actuators},
        level=f"CCL 1 {settings['level_password']}",
        store_password=settings["store_password"],
    )


async def open_tracker(site: Site) -> Tracker:
    """Connect to the site's tracker; raises a DeviceError if it does not answer."""
    return await EmsconTracker.connect(
        f"{site.tracker.host}:{site.tracker.port}", time_scale=site.clock_scale
    )
