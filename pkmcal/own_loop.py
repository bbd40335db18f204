"""An event loop in a thread of its own, for calls that return when their job is done."""

import asyncio
import threading
from collections.abc import Callable, Coroutine
from concurrent import futures
from typing import Any, TypeVar

_Answer = TypeVar("_Answer")
_LOOK_S = 0.2
"""How often a waiting call looks whether the user interrupted it."""


class OwnLoop:
    """Begins with the first call; works where another loop runs, in a notebook for example.

    Parameters
    ----------
    stop : callable
        What an interrupt (Ctrl-C) does first; the call that waits ends by that.
    """

    def __init__(self, stop: Callable[[], Coroutine[Any, Any, object]]) -> None:
        self._stop = stop
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def wait(self, job: Coroutine[Any, Any, _Answer]) -> _Answer:
        """Do a job in the loop and wait; an interrupt stops the machine first."""
        loop = self._started()
        doing = asyncio.run_coroutine_threadsafe(job, loop)
        while not doing.done():
            try:
                futures.wait([doing], timeout=_LOOK_S)
            except KeyboardInterrupt:
                asyncio.run_coroutine_threadsafe(self._stop(), loop)
        return doing.result()

    def close(self, last: Callable[[], Coroutine[Any, Any, object]]) -> None:
        """Do one more job and end the loop; nothing where it has not begun."""
        loop, thread = self._loop, self._thread
        if loop is None or thread is None:
            return
        try:
            self.wait(last())
        finally:
            loop.call_soon_threadsafe(loop.stop)
            thread.join()
            loop.close()
            self._loop = self._thread = None

    def _started(self) -> asyncio.AbstractEventLoop:
        if self._loop is None:
            self._loop = asyncio.new_event_loop()
            self._thread = threading.Thread(
                target=self._loop.run_forever, daemon=True, name="station"
            )
            self._thread.start()
        return self._loop
