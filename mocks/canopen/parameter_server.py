"""How the controller shows its parameters on the wire, with what has been made to go wrong."""

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from canopen.sdo.exceptions import SdoAbortedError

from mocks.canopen.node import (
    ABORT_CANNOT_STORE,
    ABORT_DEVICE_STATE,
    ABORT_RANGE,
    LOAD,
    SAVE,
    check_signature,
    real64_block,
)
from mocks.canopen.parameters import ParameterSet, acceptable
from mocks.canopen.ports import Faults

if TYPE_CHECKING:
    from mocks.canopen.controller import Controller

ABORT_NO_SUBINDEX = 0x0609_0011
ABORT_HARDWARE = 0x0606_0000
CORRUPTION = 0.125


class ParameterServer:
    """Installs the parameter objects of a controller.

    Injected faults: ``parameter-missing:NAME`` (unknown on the wire, absent from the block),
    ``parameter-nan:NAME`` and ``parameter-corrupt:NAME`` (answered wrongly), ``write-refused:NAME``
    (abort 0x06060000), ``write-lost:NAME`` (acknowledged, but the old value stays).
    """

    def __init__(self, controller: "Controller", parameters: ParameterSet, faults: Faults) -> None:
        self._controller = controller
        self._parameters = parameters
        self._faults = faults
        for name, address in parameters.address.items():
            controller.readers[address] = partial(self._read, name)
            controller.writers[address] = partial(self._write, name)
        controller.readers |= {
            (0x2500, 1): lambda: parameters.checksum(self._shown()),
            (0x2500, 2): lambda: parameters.checksum(parameters.kept),
            (0x2502, 0): lambda: self._block(list(parameters.kinematic)),
            (0x2503, 0): lambda: self._block(list(parameters.compensation)),
        }
        controller.writers |= {
            (0x1010, 1): partial(self._keep, SAVE, parameters.store),
            (0x1011, 1): partial(self._keep, LOAD, parameters.forget),
            (0x2501, 1): partial(self._keep, LOAD, parameters.reload),
        }

    def _keep(self, signature: int, action: Callable[[], None], value: int) -> None:
        """Store, restore or reload: with the signature, and with no motor under power."""
        check_signature(value, signature)
        self._refuse_under_power()
        if signature == SAVE and "store-refused" in self._faults:
            raise SdoAbortedError(ABORT_CANNOT_STORE)
        action()

    def _refuse_under_power(self) -> None:
        if self._controller.any_drive_enabled:
            raise SdoAbortedError(ABORT_DEVICE_STATE)

    def _shown(self) -> dict[str, float]:
        shown = dict(self._parameters.active)
        for name in self._faults.arguments("parameter-corrupt") & shown.keys():
            shown[name] += CORRUPTION
        for name in self._faults.arguments("parameter-nan") & shown.keys():
            shown[name] = math.nan
        return shown

    def _read(self, name: str) -> float:
        if name in self._faults.arguments("parameter-missing"):
            raise SdoAbortedError(ABORT_NO_SUBINDEX)
        return self._shown()[name]

    def _block(self, names: list[str]) -> bytes:
        shown = self._shown()
        missing = self._faults.arguments("parameter-missing")
        values = [shown[name] for name in names if name not in missing]
        return real64_block(values, self._parameters.checksum(shown))

    def _write(self, name: str, value: float) -> None:
        self._refuse_under_power()
        if name in self._faults.arguments("write-refused"):
            raise SdoAbortedError(ABORT_HARDWARE)
        if not acceptable(name, value, self._parameters.defaults[name]):
            raise SdoAbortedError(ABORT_RANGE)
        if name not in self._faults.arguments("write-lost"):
            self._parameters.active[name] = value
