"""All drives of one machine on an open link: recognised, set up, watched and stopped together."""

import asyncio
from dataclasses import replace
from functools import partial

from drivers.canopen.drive402 import (
    CYCLIC_POSITION,
    PROFILE_POSITION,
    STATUSWORD,
    Drive402,
    state_name,
)
from drivers.canopen.link import CanLink
from drivers.canopen.nodes import Nodes
from drivers.drives.axis import Axis
from drivers.drives.plan import Plan
from drivers.drives.recognise import check_eds, recognise, together
from drivers.drives.set_up import SetUp
from drivers.drives.sync import take_setpoints
from drivers.drives.units import counts_of
from drivers.errors import ConnectFailed, DeviceError, DeviceFault, Refused, Silence
from drivers.interface import Alarm, Identity


class DriveBus(Nodes):
    """The drives of a plan. A fault of one of them stops all: nobody else would."""

    def __init__(self, link: CanLink, plan: Plan) -> None:
        super().__init__(link)
        self.plan = plan
        self.axes: list[Axis] = list(plan.axes)
        for axis in plan.axes:
            label = f"drive {axis.name} (node {axis.node})"
            device = link.add_device(axis.node, axis.eds, label, pdos=False)
            self.drives.append(Drive402(device, axis.name))
            self.devices.append(device)
        self._set_ups: dict[int, SetUp] = {}
        self._asking: set[asyncio.Task[None]] = set()

    @property
    def mode(self) -> int:
        """Mode of operation in which the drives move together."""
        return CYCLIC_POSITION if self.plan.cyclic else PROFILE_POSITION

    async def recognise(self) -> Identity:
        """Return who answers; raises ConnectFailed or Refused."""
        identities = []
        for n, (drive, axis) in enumerate(zip(self.drives, self.axes, strict=True)):
            identities.append(await self._recognise(drive, axis))
            ask = partial(counts_of, drive, axis, self.plan.feed_unit, self.plan.believe)
            counts = await drive.remote.call(ask)
            self.axes[n] = replace(axis, counts=counts)
            self._set_ups[axis.node] = SetUp(drive, self.axes[n], self.plan)
        identity = together(identities)
        if self.plan.serial and identity.serial != self.plan.serial:
            raise Refused(
                f"have serial numbers {identity.serial}, expected {self.plan.serial}",
                device="drives",
                remedy="Connect the right machine, or correct the site file; a drive that was "
                "exchanged has another reference.",
            )
        return identity

    async def _recognise(self, drive: Drive402, axis: Axis) -> Identity:
        try:
            return await drive.remote.call(lambda: recognise(drive, axis.eds, self.mode))
        except Silence as error:
            raise ConnectFailed(
                f"the adapter answers, {drive.device} does not",
                device=self.link.name,
                remedy="Check that the drive is switched on, its node number and the bit rate.",
            ) from error

    async def watch(self) -> None:
        """As of any nodes, and every drive set up as the plan says."""
        for axis in self.axes:
            set_up = self._set_ups[axis.node]
            await set_up.run()
            if self.plan.cyclic:
                await take_setpoints(set_up.drive, axis, self.plan.sync_s)
        await super().watch()

    async def farewell(self) -> None:
        """As of any nodes; and limits are those that the drives held before."""
        await super().farewell()
        await asyncio.gather(*(set_up.give_back() for set_up in self._set_ups.values()))

    def window(self, axis: Axis) -> int:
        """How many counts from its target a drive has arrived."""
        return self._set_ups[axis.node].window

    def soft_limits(self, axis: Axis) -> tuple[int, int]:
        """Limits of site file, machine file and drive together, in counts."""
        return self._set_ups[axis.node].limits

    # ------------------------------------------------------------ what comes unasked

    def must_halt(self, fault: DeviceError) -> bool:
        """Every fault of a drive stops all."""
        return isinstance(fault, DeviceFault)

    def _on_emergency(self, node_id: int, code: int, register: int) -> None:
        """A maker may warn by EMCY: whether it is a fault is asked of the drive."""
        if code == 0:
            super()._on_emergency(node_id, code, register)
            return
        task = asyncio.ensure_future(self._ask(node_id, code))
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    async def _ask(self, node_id: int, code: int) -> None:
        drive = next(drive for drive in self.drives if drive.remote.id == node_id)
        try:
            state = state_name(await drive.read(STATUSWORD))
        except DeviceError:  # lost meanwhile, for example
            state = "fault"
        if state.startswith("fault"):
            self.latch_drive(node_id, code)
        else:
            self.alarm(Alarm(drive.device, f"reports 0x{code:04X} and goes on"))


def check_files(plan: Plan) -> None:
    """Raise DeviceError for an EDS file that is none, before a bus is opened."""
    for axis in plan.axes:
        check_eds(axis)
