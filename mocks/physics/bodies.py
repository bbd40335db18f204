"""The kinds of machines that there are mocks of."""

from functools import cache

from mocks.physics.body import Body
from mocks.physics.hexapod_body import HexapodBody
from mocks.physics.ptm_body import PtmBody
from mocks.physics.tripod_body import TripodBody

BODIES: dict[str, type[HexapodBody] | type[TripodBody] | type[PtmBody]] = {
    "hexapod": HexapodBody,
    "tripod": TripodBody,
    "ptm": PtmBody,
}


@cache
def body_named(name: str) -> Body:
    """The kind of machine of this name; raises ValueError if there is no mock of it."""
    if name not in BODIES:
        raise ValueError(f'there is no mock of "{name}"; there are mocks of {", ".join(BODIES)}')
    return BODIES[name]()
