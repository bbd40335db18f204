"""The physics of the mock machines, written independently of the engine that they test."""
