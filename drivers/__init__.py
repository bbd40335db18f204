"""Hardware links: CANopen controllers, emScon laser trackers, serial controllers."""
