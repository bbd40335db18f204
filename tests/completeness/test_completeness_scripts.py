"""Every verb has its call in scripts, or stands on the page among those that have none, and why."""

import re
from pathlib import Path

import pytest

import pkmcal
from tests.completeness.test_completeness_verbs import VERBS

PAGE = (Path(__file__).parents[2] / "docs" / "scripting.md").read_text("utf-8")
OTHERWISE = {
    "poses": ("choose_poses", "verification_grid"),
    "import": ("import_run", "guess_map"),
    "sessions": ("list_sessions",),
    "log": ("session_log",),
    "history": ("history_of",),
    "machine check": ("check_machine",),
    "machine complete": ("complete",),
    "site kinds": ("site_kinds",),
    "fleet fit": ("fit_fleet",),
    "mock": ("mock_station",),
    "undo": ("undo", "sets", "accept"),
}
"""Calls that are not named like their verb."""
WITHOUT = dict(re.findall(r"^\| `([a-z0-9 -]+)` \| ([^|]+) \|$", PAGE, re.MULTILINE))


@pytest.mark.parametrize("verb", VERBS)
def test_completeness_verb_has_its_call_or_a_reason_on_the_page(verb: str) -> None:
    calls = OTHERWISE.get(verb, (verb,))
    there = [hasattr(pkmcal.Station, call) or call in pkmcal.__all__ for call in calls]
    if verb in WITHOUT:
        assert not any(there)
        assert len(WITHOUT[verb]) > 10
    else:
        assert all(there), verb
        assert all(re.search(rf"\b{call}\(", PAGE) for call in calls)


def test_completeness_page_names_no_verb_that_is_gone() -> None:
    assert set(WITHOUT) <= set(VERBS)
    assert set(OTHERWISE) <= set(VERBS)
