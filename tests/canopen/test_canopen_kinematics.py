"""The controller's closed-form kinematics and its compensation, as laws."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.machines import load_shipped
from mocks.canopen.compensation import Compensation, direction_of
from mocks.canopen.hexapod_kinematics import PARAMETERS, Unreachable, leg_length, leg_lengths, rotation

HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)
