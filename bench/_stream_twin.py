"""A server that answers nothing and takes as long: what the computer itself does to a stream.

    python -m bench._stream_twin CPU_SECONDS BYTES

Each line that comes is answered by a line of so many bytes, after so many seconds of CPU.
"""

import asyncio
import sys
import time


def burn(cpu_s: float) -> None:
    """Take so many seconds of CPU of this thread."""
    end = time.thread_time() + cpu_s
    while time.thread_time() < end:
        pass


async def serve(cpu_s: float, size: int) -> None:
    """Answer until the process is ended; the port is printed."""
    line = b'{"ok": true}'.ljust(size) + b"\n"

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while await reader.readline():
            burn(cpu_s)
            writer.write(line)
            await writer.drain()

    server = await asyncio.start_server(talk, "127.0.0.1", 0, limit=1 << 20)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(serve(float(sys.argv[1]), int(sys.argv[2])))
