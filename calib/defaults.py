"""Numbers that functions take where they are told none; light, as help texts state them."""

POSES_FROM = 2500
"""Reachable candidates from which measurement poses are chosen."""
FOLLOW_UP_FROM = 250
"""The same for a follow-up that tells two effects apart."""
