"""What an emScon tracker is, and how it is set before it measures."""

from collections.abc import Awaitable, Callable

from drivers.emscon import wire
from drivers.emscon.codes import Angle, Coordinates, Length, Pressure, ProcessorStatus, Temperature
from drivers.emscon.settings import EmsconSettings
from drivers.errors import Refused
from drivers.interface import Identity

INITIALIZE_S = 90.0

Ask = Callable[..., Awaitable[wire.Packet]]
"""Name, device seconds and values -> the answer; statuses are raised as typed errors."""


async def identify(ask: Ask) -> Identity:
    """Who answers; of old firmware the serial number alone."""
    try:
        info = await ask("GetTrackerInfo")
    except Refused:
        system = await ask("GetSystemStatus")
        return Identity("emscon", serial=str(system.integer("serial")))
    firmware = f"{info.integer('major')}.{info.integer('minor')}"
    serial = str(info.integer("serial"))
    return Identity("emscon", "", info.text("name"), serial, firmware)


async def set_up(ask: Ask, settings: EmsconSettings) -> None:
    """Set units, frame, weather and statistics; initialise the tracker if it is not yet."""
    await ask(
        "SetUnits", length=Length.MILLIMETRE, angle=Angle.RADIAN, humidity=0,
        temperature=Temperature.CELSIUS, pressure=Pressure.HPA,
    )  # fmt: skip
    if settings.environment is not None:
        temperature, pressure, humidity = settings.environment
        await ask(
            "SetEnvironmentParams", temperature=temperature, pressure=pressure, humidity=humidity
        )
    system = await ask("GetSystemStatus")
    if system.integer("processor") != ProcessorStatus.INITIALIZED:
        await ask("Initialize", INITIALIZE_S)
    await ask("SetCoordinateSystemType", coordinates=Coordinates.RIGHT_HANDED)
    await ask(
        "SetSystemSettings", weather_monitor=settings.weather_monitor,
        apply_transformation=0, apply_orientation=0, keep_last_position=1, send_unsolicited=1,
        send_reflector_position=0, try_mode=0, has_nivel=0, has_video=0,
    )  # fmt: skip
    await ask("SetStatisticMode", stationary=1, continuous=0)
    await ask(
        "SetSearchParams",
        radius=settings.search_radius_mm,
        timeout_ms=round(1000.0 * settings.search_timeout_s),
    )
