"""Adapters that cannot be opened are a sentence, whatever python-can's interfaces raise."""

import pytest

from drivers.canopen import CanopenController
from drivers.canopen.link import BusAddress
from drivers.errors import ConnectFailed


@pytest.mark.parametrize(
    ("interface", "channel"),
    [
        ("kvaser", "0"),  # a library of the maker's
        ("kvaser", "can0"),  # channels are numbers there
        ("socketcand", "can0"),  # needs host and port
        ("neovi", "1"),
        ("ixxat", "0"),
        ("gs_usb", "0"),
        ("slcan", "/dev/no-such-adapter"),
        ("nonsense", "0"),
    ],
)
async def test_it_is_said_in_words(interface: str, channel: str) -> None:
    with pytest.raises(ConnectFailed) as caught:
        await CanopenController.connect(interface, channel)
    assert interface in str(caught.value)
    assert caught.value.remedy


def test_further_keywords_reach_the_interface() -> None:
    address = BusAddress("udp_multicast", "239.74.163.2", more={"hop_limit": 0})
    assert address.options()["hop_limit"] == 0
