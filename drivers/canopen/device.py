"""A node on the bus, and the way to it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import canopen

if TYPE_CHECKING:
    from drivers.canopen.link import CanLink

T = TypeVar("T")


class Device:
    """A remote node on a link, with blocking access (for :meth:`call`) and the way to it."""

    def __init__(self, link: "CanLink", node_id: int, label: str, node: canopen.RemoteNode) -> None:
        self.link = link
        self.id = node_id
        self.label = label
        self.node = node

    async def call(self, action: Callable[[], T]) -> T:
        """Run blocking ``action`` in a worker thread; raises as :meth:`CanLink.call`."""
        return await self.link.call(self.id, action)

    def upload(self, index: int, sub: int = 0) -> bytes:
        """Read an object; blocking."""
        return bytes(self.node.sdo.upload(index, sub))

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write an object; blocking."""
        self.node.sdo.download(index, sub, data)
