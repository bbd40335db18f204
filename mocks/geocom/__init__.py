"""A total station that speaks GeoCOM, in the room of the mock machine."""
