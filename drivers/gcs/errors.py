"""What ``ERR?`` answers, in words, with what to do about it."""

from drivers.errors import DeviceError, DeviceFault, DriveFault, Refused

UNKNOWN_COMMAND, STARTING = 2, 63
NOT_ENABLED, STOPPED, UNKNOWN_PARAMETER, MOTION_ERROR = 5, 10, 54, 1024

WORDS = {
    1: ("syntax error", "Check that this controller speaks GCS 2.0."),
    UNKNOWN_COMMAND: ("unknown command", "Check that this is the controller of the site file."),
    NOT_ENABLED: (
        "an axis is not enabled or does not know its reference",
        "Enable the machine; home the actuators that lost their reference.",
    ),
    7: (
        "a target is outside the controller's limits",
        "Choose a pose within the actuators' travel; check the parameters if it should be.",
    ),
    8: ("velocity outside limits", "Choose a lower speed at the controller."),
    STOPPED: (
        "the motion was stopped",
        "Enable the machine and command the pose again.",
    ),
    15: ("there is no such axis or item", "Check the axes in the site file."),
    17: ("a value is out of range", "Check the value that was to be written."),
    22: ("an axis is named twice", "Check the axes in the site file."),
    23: ("these axes cannot be moved together", "Check pose_axes in the site file."),
    25: ("a value is not a number", "Check the cable: what is sent arrives damaged."),
    UNKNOWN_PARAMETER: (
        "unknown parameter",
        "Check that machine file and controller belong together.",
    ),
    56: ("wrong password", "Check the passwords in the site file."),
    60: ("the parameter is protected", "Check the command level's password in the site file."),
    64: ("the parameter is read only", "Check the parameter's number in the manual."),
    STARTING: ("it is still starting up", "Wait until it is ready, then try again."),
    93: ("not allowed while an axis moves", "Stop the machine first."),
    95: ("not allowed while servos are on", "Disable motion first, then try again."),
    305: ("its memory cannot be written", "The old values are still stored."),
    333: ("hardware error", "Restore the snapshot, switch the controller off and on, try again."),
    530: ("there is no coordinate system of that name", "Check system in the site file."),
    536: ("not allowed while the hexapod moves", "Stop the machine first."),
    544: (
        "this coordinate system has its own centre of rotation: a pivot cannot be set",
        "Define the pivot with the coordinate system, or use another one.",
    ),
    MOTION_ERROR: (
        "a servo switched itself off",
        "Remove the cause, clear the faults and enable the machine again.",
    ),
    4001: ("its memory cannot be written", "The old values are still stored."),
    4002: ("its memory cannot be read: it works with its defaults", "Bring a known set back."),
}


def refusal(code: int, command: str, device: str) -> DeviceError:
    """Return the exception for a command that ended with ``code``."""
    words, remedy = WORDS.get(code, ("unknown error", "See the controller's manual."))
    if code == STOPPED:
        return DeviceFault(words, device=device, remedy=remedy)
    if code == MOTION_ERROR:
        return DriveFault(f"{words} (GCS error {code})", device=device, remedy=remedy)
    what = f"refuses {command!r}: {words} (GCS error {code})"
    return Refused(what, device=device, remedy=remedy, code=code)
