"""CANopen nodes of the mock machine: CiA 402 drives and a motion controller."""
