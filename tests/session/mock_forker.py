"""A process that forks mock stations, with everything imported and read that all of them need.

Run with the descriptor of a socket. Each message asks for one station: its command line as JSON,
with two descriptors, which become its standard input and output; the answer is its process number.
"""

import json
import os
import signal
import socket
import sys

import mocks.station
from drivers.canopen.eds import dictionary, drive_eds_path, eds_path
from mocks.physics.truth import machine_file

LONGEST = 65536


def warm_up() -> None:
    """Read what every station reads, so that those forked from here have it."""
    machine_file("hexapod")
    dictionary(eds_path("hexapod_controller"), 10)
    for number in range(1, 7):
        dictionary(drive_eds_path("hexapod"), number)


def serve(asked: socket.socket) -> None:
    """Fork until nobody asks any more."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        message, (*descriptors,), _, _ = socket.recv_fds(asked, LONGEST, 2)
        if not message:
            return
        process = os.fork()
        if process == 0:
            run(json.loads(message), asked, descriptors)
        for descriptor in descriptors:
            os.close(descriptor)
        asked.sendall(f"{process}\n".encode())


def run(arguments: list[str], asked: socket.socket, descriptors: list[int]) -> None:
    """Be a station; never returns."""
    code = 1
    try:
        asked.close()
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for own, descriptor in enumerate(descriptors):
            os.dup2(descriptor, own)
            os.close(descriptor)
        code = mocks.station.main(arguments)
    finally:
        os._exit(code)


if __name__ == "__main__":
    warm_up()
    serve(socket.socket(fileno=int(sys.argv[1])))
