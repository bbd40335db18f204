"""All nodes of one machine: recognised, configured, watched, halted and left together."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from drivers.canopen.drive402 import QUICK_STOP, Drive402
from drivers.canopen.eds import drive_eds_path, need_dictionary
from drivers.canopen.layout import Layout
from drivers.canopen.link import CanLink
from drivers.canopen.motion import STOP, MotionChannel
from drivers.canopen.nodes import Nodes
from drivers.canopen.recognise import check_limits, check_serial, read_identity
from drivers.errors import ConnectFailed, Silence
from drivers.interface import Identity


class MachineBus(Nodes):
    """The controller node and its drives on an open link.

    ``drive_nodes`` are 1, 2, ... if there are none; ``drive_eds`` is the shipped one, one for all,
    or one for each.
    """

    def __init__(
        self,
        link: CanLink,
        layout: Layout,
        node_id: int,
        eds: Path,
        drive_nodes: Sequence[int] = (),
        drive_eds: Sequence[Path] = (),
    ) -> None:
        super().__init__(link)
        self.layout = layout
        self.controller = link.add_device(node_id, eds, f"controller (node {node_id})")
        count = len(layout.actuators)
        files = list(drive_eds) or [drive_eds_path(layout.machine)]
        files = files * count if len(files) == 1 else files
        nodes = list(drive_nodes) or range(1, count + 1)
        for number, name, file in zip(nodes, layout.actuators, files, strict=True):
            need_dictionary(file, number, f"drive {name}")
            device = link.add_device(number, file, f"drive {name} (node {number})")
            self.drives.append(Drive402(device, name))
        self.devices = [self.controller, *(drive.remote for drive in self.drives)]
        self.motion = MotionChannel(self.controller, layout)

    async def recognise(
        self, serial: str | None, limits: Mapping[str, tuple[float, float]]
    ) -> Identity:
        """Return who answers; raises ConnectFailed or Refused (see recognise.py)."""
        controller = self.controller
        try:
            identity = await controller.call(lambda: read_identity(controller, self.layout))
        except Silence as error:
            raise ConnectFailed(
                f"the adapter answers, {controller.label} does not",
                device=self.link.name,
                remedy="Check that the controller is switched on, its node number and bit rate.",
            ) from error
        check_serial(identity, serial, controller.label)
        await controller.call(lambda: check_limits(controller, self.layout, limits))
        return identity

    async def watch(self) -> None:
        """As of any nodes; then take over the controller's sequence number."""
        await super().watch()
        await self.motion.synchronise()

    def wake(self) -> None:
        """Let those who wait for the controller's status look again."""
        self.motion.wake()

    async def send_stop(self, controlword: int = QUICK_STOP) -> None:
        """Stop the controller's motion and send ``controlword`` to every drive; raises LinkLost."""
        await self.send_controlword(controlword, (self.motion.command_frame(STOP),))
