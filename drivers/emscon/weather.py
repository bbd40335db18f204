"""What an emScon tracker measures of the air and of the object, and what it lacks for that."""

from drivers import plausible
from drivers.emscon.setting_up import Ask
from drivers.errors import Refused
from drivers.interface import TrackerCan

AIR = {"air_temp_C": "temperature", "pressure_hPa": "pressure", "humidity": "humidity"}


async def channels_of(ask: Ask, can: TrackerCan, device: str) -> dict[str, float]:
    """Of object and air: deg C, hPa, relative humidity in %."""
    found = {}
    if can.object_temperature:
        thing = await ask("GetObjectTemperature")
        temperature = thing.real("temperature")
        found["structure_temp_C"] = plausible.weather("temperature", temperature, device)
    if can.weather:
        air = await ask("GetEnvironmentParams")
        for name, field in AIR.items():
            found[name] = plausible.weather(field, air.real(field), device)
    return found


async def require_weather(ask: Ask, device: str) -> None:
    """Refraction is a person's decision: without a station somebody must state the air."""
    try:
        await ask("GetEnvironmentParams")
    except Refused as error:
        raise Refused(
            f"it has no weather station ({error.what})",
            device=device,
            remedy='Connect it, or write weather = "off" and environment = [deg C, hPa, %] '
            "under [tracker] in the site file",
        ) from error


async def lacks_object_sensor(ask: Ask) -> str:
    """Ask for the object's temperature once: why nothing measures it; empty if something does."""
    try:
        await ask("GetObjectTemperature")
    except Refused as error:
        return error.what
    return ""
