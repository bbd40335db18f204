"""Every screen has a picture, which the page of the screens shows and a command takes."""

from pathlib import Path

import pytest

from app.tui.program import FACES, SIDES

DOCS = Path(__file__).parents[2] / "docs"
SCREENS = (*FACES, *SIDES)


@pytest.mark.parametrize("face", SCREENS, ids=[face.mode for face in SCREENS])
def test_completeness_screen_has_a_picture_that_is_taken_and_shown(face: type) -> None:
    mode = face.mode
    assert (DOCS / "images" / f"{mode}.svg").is_file()
    assert f"](images/{mode}.svg)" in (DOCS / "terminal-ui.md").read_text(encoding="utf-8")
    taken = (DOCS / "images" / "take_screenshots.py").read_text(encoding="utf-8")
    assert f'picture("{mode}")' in taken


def test_completeness_screens_have_names_of_their_own_and_say_what_they_are_for() -> None:
    for each in ("mode", "label", "about"):
        said = [getattr(face, each) for face in SCREENS]
        assert all(said)
        assert len(set(said)) == len(said)


def test_completeness_no_picture_is_left_over() -> None:
    page = (DOCS / "terminal-ui.md").read_text(encoding="utf-8")
    for path in (DOCS / "images").glob("*.svg"):
        assert f"](images/{path.name})" in page, path
