"""What is written to a terminal that is gone is lost, and ends nothing."""

import os

import pytest

from app.lasting import Lasting

pty = pytest.importorskip("pty")


def test_writing_to_a_terminal_that_is_gone_is_no_error():
    near, far = pty.openpty()
    with os.fdopen(far, "w", buffering=1) as stream:
        stream.write("before\n")
        os.close(near)
        with pytest.raises(OSError, match=r"Errno 5"):
            os.write(far, b"x")
        lasting = Lasting(stream)
        lasting.write("after\n")
        lasting.flush()
        assert stream.writable()
        lasting.write("and on\n")
