"""Collimation error of the tracker: of opposite sign in its two faces; the live tracker's alone."""

from mocks.hidden.effect import EVERYWHERE, HiddenEffect, Site, Table


class TwoFace(HiddenEffect):
    """An angle that a reading in both faces removes."""

    id = "unknown.two-face"
    numbers = "hz"
    says = "rad: collimation error, of opposite sign in the two faces"
    unseen = EVERYWHERE

    def example(self, site: Site) -> Table:
        """Ten times what a good tracker has."""
        return {"unknown.two-face.hz": 2e-5}


EFFECTS = (TwoFace(),)
