"""The whole job on the mock hexapod, without a person."""
