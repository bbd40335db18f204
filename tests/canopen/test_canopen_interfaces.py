"""Adapters that cannot be opened are a sentence, whatever python-can's interfaces raise."""

import can
import pytest
from can.interfaces.virtual import VirtualBus

from drivers.canopen import CanopenController
from drivers.canopen.bus_address import BusAddress
from drivers.canopen.link import CanLink
from drivers.errors import ConnectFailed

THERE = {"virtual", "udp_multicast", "socketcand"}
"""They open, ask the network for a name, or wait for their host (below)."""


@pytest.mark.parametrize(
    ("interface", "channel"),
    [
        *((name, "0") for name in sorted(can.VALID_INTERFACES - THERE)),
        ("kvaser", "can0"),  # channels are numbers there
        ("socketcand", "can0"),  # needs host and port
        ("slcan", "/dev/no-such-adapter"),
        ("nonsense", "0"),
    ],
)
async def test_it_is_said_in_words(interface: str, channel: str) -> None:
    with pytest.raises(ConnectFailed) as caught:
        await CanopenController.connect(interface, channel)
    assert interface in str(caught.value)
    assert caught.value.remedy


async def test_a_keyword_of_another_kind_points_to_its_table() -> None:
    address = BusAddress("udp_multicast", "239.74.163.2", more={"hop_limit": "one"})
    with pytest.raises(ConnectFailed, match=r"\[controller\.can\]"):
        await CanLink.open(address)


async def test_keywords_of_the_site_file_reach_python_can() -> None:
    """Whatever stands in ``[controller.can]``; here a bus that says what it got."""
    link = await CanLink.open(
        BusAddress("virtual", "pkmcal", more={"receive_own_messages": True, "rx_queue_size": 7})
    )
    try:
        bus = link._network.bus
        assert isinstance(bus, VirtualBus)
        assert bus.receive_own_messages
        assert bus.queue.maxsize == 7
    finally:
        await link.close()


def test_further_keywords_reach_the_interface() -> None:
    address = BusAddress("udp_multicast", "239.74.163.2", more={"hop_limit": 0})
    assert address.options()["hop_limit"] == 0
