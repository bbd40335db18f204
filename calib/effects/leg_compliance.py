"""Every leg is a spring of its own under the weight: extension_i = c_i F_i, F_i > 0 in tension.

One c for all is the case of equal legs, ``gravity-sag``: what tells the two apart is how legs
differ.
"""

from calib.effects.gravity_sag import WEIGHT_UPWARDS, spring_compliance
from calib.effects.under_force import PerForce
from calib.mechanism.description import Machine


class LegCompliance(PerForce):
    """One compliance for each actuator."""

    id = "leg-compliance"
    says = "legs or drives give way under the weight, each by a compliance of its own"
    depends = ("run", "payload_kg")
    wrong_sign = WEIGHT_UPWARDS
    wrong_size = "payload_kg, or a mass in [load], is not in kg (payload in grams?)"

    def lacking(self, machine: Machine) -> str:
        """The actuators must be what yields."""
        rods = spring_compliance(machine) > 0.0
        return "its rods are what yields (trait yields), its actuators hold" if rods else ""


EFFECTS = (LegCompliance(),)
