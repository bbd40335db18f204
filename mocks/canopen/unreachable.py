"""What a controller says of a pose that it cannot reach."""


class Unreachable(Exception):
    """No actuator coordinates belong to the pose with these parameters; ``leg`` counts from 0."""

    def __init__(self, leg: int) -> None:
        super().__init__(f"actuator {leg + 1} does not reach the pose")
        self.leg = leg
