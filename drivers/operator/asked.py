"""A question to a person, who has no deadline, but whom a stop spares the answer."""

import asyncio
from collections.abc import Awaitable


async def unless_stopped(question: Awaitable[str], stopped: asyncio.Event) -> str | None:
    """What was answered; None where the stop came first."""
    asking = asyncio.ensure_future(question)
    stopping = asyncio.ensure_future(stopped.wait())
    try:
        await asyncio.wait([asking, stopping], return_when=asyncio.FIRST_COMPLETED)
        return asking.result() if asking.done() else None
    finally:
        asking.cancel()
        stopping.cancel()
        await asyncio.gather(asking, stopping, return_exceptions=True)
