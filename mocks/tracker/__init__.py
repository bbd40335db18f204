"""A mock laser tracker on TCP: emScon TPI subset, looking at the station's world."""
