"""Everything that can go wrong on a wire, readable at a glance.

::

    DeviceError                 something is wrong with a device or its link
    |-- LinkError               the link itself
    |   |-- ConnectFailed       nobody answers at that address
    |   |-- LinkLost            the link was there and is gone
    |   `-- Silence             an answer did not come before its deadline
    |-- ProtocolError           an answer came that the protocol does not allow
    |-- Refused                 the device said no
    |-- DeviceFault             the device reports a fault of its own
    |   |-- DriveFault          a drive is in fault, or reports an emergency
    |   `-- HeartbeatLost       a node's heartbeat stopped
    |-- MeasurementError        a reading could not be taken
    |   |-- BeamBroken          the beam was interrupted; no reading was made
    |   |-- NotReady            the tracker is not initialised, warm or stable
    |   |-- NoNumber            an instrument of one number shows none: out of its range, an error
    |   `-- NoTarget            no reflector where one was expected
    `-- ParameterError          the controller's parameters are not what they should be
"""


class DeviceError(Exception):
    """Something is wrong with a device; the program ends with exit code 3.

    Parameters
    ----------
    what : str
        What happened, in words.
    device : str, optional
        Which device: ``"tracker 127.0.0.1:700"``, ``"drive leg 3 (node 3)"``.
    remedy : str, optional
        What the operator should do.
    """

    def __init__(self, what: str, *, device: str = "", remedy: str = "") -> None:
        self.what = what
        self.device = device
        self.remedy = remedy
        text = f"{device}: {what}" if device else what
        super().__init__(f"{text}. {remedy}" if remedy else text)


class LinkError(DeviceError):
    """The link itself."""


class ConnectFailed(LinkError):
    """Nobody answers at that address."""


class LinkLost(LinkError):
    """The link was there and is gone."""


class Silence(LinkError):
    """An answer did not come before its deadline."""


class ProtocolError(DeviceError):
    """An answer came that the protocol does not allow."""


class Refused(DeviceError):
    """The device said no; ``code`` is its own number."""

    def __init__(
        self, what: str, *, device: str = "", remedy: str = "", code: int | None = None
    ) -> None:
        super().__init__(what, device=device, remedy=remedy)
        self.code = code


class DeviceFault(DeviceError):
    """The device reports a fault of its own."""


class DriveFault(DeviceFault):
    """A drive is in fault, or reports an emergency."""


class HeartbeatLost(DeviceFault):
    """A node's heartbeat stopped."""


class MeasurementError(DeviceError):
    """A reading could not be taken."""


class BeamBroken(MeasurementError):
    """The beam was interrupted; no reading was made."""


class NotReady(MeasurementError):
    """The tracker is not initialised, warm or stable."""


class NoTarget(MeasurementError):
    """No reflector where one was expected."""


class NoNumber(MeasurementError):
    """An instrument of one number shows none: out of its range, or an error of its own."""


class ParameterError(DeviceError):
    """The controller's parameters are not what they should be."""
