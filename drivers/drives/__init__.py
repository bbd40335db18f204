"""CiA 402 drives alone: they take actuator values, and the host computes the legs."""
