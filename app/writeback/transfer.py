"""Writing a parameter set and proving that it is there; a set in volatile memory, or for good."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.hosted.controller import HostedController
from app.hosted.parameters import ParameterSet
from app.session.known import Held, Snapshots, read_held
from app.session.station import Station
from drivers.errors import ParameterError


@dataclass(frozen=True)
class Wanted:
    """A parameter set that is to be held: values, and texts of the operator's own effects."""

    values: Mapping[str, float]
    own: Mapping[str, str] = field(default_factory=dict)


async def write_volatile(station: Station, wanted: Wanted) -> Held:
    """Disable motion, write, and read back bit for bit.

    Raises
    ------
    ParameterError
        If a single value reads back differently.
    """
    controller = station.controller
    await controller.disable()
    if isinstance(controller, HostedController):
        await controller.replace_parameters(ParameterSet(wanted.values, wanted.own))
    else:
        await controller.write_parameters(wanted.values)
    return await prove(station, wanted, "after writing")


async def prove(station: Station, wanted: Wanted | None, when: str) -> Held:
    """Read everything back; raises ParameterError naming the first value that differs."""
    held = await read_held(station.site, station.controller)
    if wanted is None:
        return held
    values = wanted.values
    different = [name for name, value in values.items() if held.values.get(name) != value]
    if different:
        name = different[0]
        raise ParameterError(
            f"{name} reads back as {held.values.get(name)!r} {when}, "
            f"{values[name]!r} was written ({len(different)} of {len(values)} differ)",
            device="controller",
            remedy="Do not move the machine; the earlier set is being restored",
        )
    if held.own != dict(wanted.own):
        raise ParameterError(
            f"the texts of own effects read back differently {when}",
            device="controller",
            remedy="Do not move the machine; the earlier set is being restored",
        )
    return held


async def keep(station: Station, wanted: Wanted) -> Held:
    """Store the set that is in use, load it again from where it is stored, and prove it."""
    controller = station.controller
    await controller.disable()
    await controller.store_parameters()
    await controller.reload_parameters()
    return await prove(station, wanted, "after storing and loading again")


def snapshots_of(station: Station) -> Snapshots:
    """Parameter sets of the connected controller."""
    return Snapshots(station.site.machine.name, station.controller.identity)
