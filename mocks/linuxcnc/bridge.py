"""Tells where LinuxCNC's motors stand: a script under the Python that has LinuxCNC's modules.

An empty line comes in, a line of six numbers goes out. It ends with its standard input.
"""

import os
import sys

import hal

component = hal.component(f"pkmcal-bridge-{os.getpid()}")
component.ready()
for _ in sys.stdin:
    motors = [hal.get_value(f"joint.{n}.motor-pos-fb") for n in range(6)]
    print(*map(repr, motors), flush=True)
