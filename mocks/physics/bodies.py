"""The kinds of machines that there are mocks of."""

from functools import cache

from calib.mechanism.description import Machine
from mocks.arguments import MACHINES, WITH_OWN_FILES
from mocks.physics.body import Body
from mocks.physics.hexapod_body import HexapodBody
from mocks.physics.ptm_body import PtmBody
from mocks.physics.tripod_body import TripodBody
from mocks.physics.truth import machine_file

BODIES: dict[str, type[HexapodBody] | type[TripodBody] | type[PtmBody]] = dict(
    zip(MACHINES, (HexapodBody, TripodBody, PtmBody), strict=True)
)


def body_of(machine: Machine) -> Body:
    """The body of one's own machine: a shipped one's mechanism with other numbers.

    Nominal values, tolerances, limits and what is calibrated may differ. Raises ValueError for a
    mechanism that there is no mock of.
    """
    for name in WITH_OWN_FILES:
        shipped = machine_file(name)
        names = [p.name for p in shipped.parameters]
        if (
            machine.limbs == shipped.limbs
            and machine.home == shipped.home
            and machine.task == shipped.task
            and [p.name for p in machine.parameters] == names
        ):
            own = BODIES[name]()
            own.machine = machine
            return own
    raise ValueError(
        f"{machine.name}: there is no mock of this mechanism; a mock's machine file has the limbs, "
        f"home and parameters of {' or '.join(WITH_OWN_FILES)}, and numbers of its own"
    )


@cache
def body_named(name: str) -> Body:
    """The kind of machine of this name; raises ValueError if there is no mock of it."""
    if name not in BODIES:
        raise ValueError(f'there is no mock of "{name}"; there are mocks of {", ".join(BODIES)}')
    return BODIES[name]()
