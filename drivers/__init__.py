"""Hardware links: CANopen controllers, emScon laser trackers, serial controllers."""

PART_OF = "pkmcal"
