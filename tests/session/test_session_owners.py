"""One machine has one owner, at whatever address it is asked."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from session_mock import Mock

from app.errors import GateRefused
from app.session.station import Station


@pytest.mark.parametrize("hands", ["mock", "operator"])
async def test_two_addresses_of_a_machine_are_one_machine(
    mock_of: Callable[..., Mock], hands: str
) -> None:
    """Known by its serial number, or, of mocks, by the station that moves them."""
    site = mock_of("--smrs", "3").site
    if hands == "operator":
        site = replace(site, hands=replace(site.hands, kind="operator", host="", port=0))
    settings = {**site.controller.settings}
    settings["channel"] = settings["channel"].replace("127.0.0.1", "localhost")
    other = replace(site.controller, settings=settings, address=settings["channel"])
    assert other.address != site.controller.address
    first = Station(site)
    second = Station(replace(site, controller=other))
    assert first.owner.machine != second.owner.machine
    await first.connect()
    try:
        with pytest.raises(GateRefused, match="in use by process"):
            await second.connect()
        assert not second.connected
    finally:
        await first.close()
    await second.connect()
    await second.close()
