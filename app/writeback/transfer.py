"""Writing a parameter set and proving that it is there; a set in volatile memory, or for good."""

from collections.abc import Mapping

from app.session.known import Held, Snapshots, read_held
from app.session.station import Station
from drivers.errors import ParameterError


async def write_volatile(station: Station, values: Mapping[str, float]) -> Held:
    """Disable motion, write, and read back bit for bit.

    Raises
    ------
    ParameterError
        If a single value reads back differently.
    """
    controller = station.controller
    await controller.disable()
    await controller.write_parameters(values)
    return await prove(station, values, "after writing")


async def prove(station: Station, values: Mapping[str, float], when: str) -> Held:
    """Read everything back; raises ParameterError naming the first value that differs."""
    held = await read_held(station.site, station.controller)
    different = [name for name, value in values.items() if held.values.get(name) != value]
    if different:
        name = different[0]
        raise ParameterError(
            f"{name} reads back as {held.values.get(name)!r} {when}, "
            f"{values[name]!r} was written ({len(different)} of {len(values)} differ)",
            device="controller",
            remedy="Do not move the machine; the earlier set is being restored",
        )
    return held


async def keep(station: Station, values: Mapping[str, float]) -> Held:
    """Store the set that is in use, load it again from where it is stored, and prove it."""
    controller = station.controller
    await controller.disable()
    await controller.store_parameters()
    await controller.reload_parameters()
    return await prove(station, values, "after storing and loading again")


def snapshots_of(station: Station) -> Snapshots:
    """Parameter sets of the connected controller."""
    return Snapshots(station.site.machine.name, station.controller.identity)
