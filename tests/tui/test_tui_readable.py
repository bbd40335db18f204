"""What an operator decides by is in sight at 80 columns: largest first, whole reasons, whole p."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
import tui_stream as stream
from rich.text import Text
from textual.app import App, ComposeResult
from textual.widgets import DataTable

from app.files.machines import load_machine
from app.session.events import GateChecked, WriteBackStage
from app.tui.apply import gates_text, grouped, rows_of
from app.tui.discover import found_text, largest_text, stairs_text
from app.tui.program import Workbench
from app.tui.verify import running_text
from app.tui.widgets.plots import MissPlot, Spaced
from app.tui.widgets.tables import fill
from calib.effects import catalogue


def columns(bench: Workbench, table: str) -> tuple[int, int]:
    """Width of all columns of a table together, and of the room that it has."""
    found = bench.screen.query_one(f"#{table}", DataTable)
    return sum(column.get_render_width(found) for column in found.ordered_columns), (
        found.scrollable_content_region.width
    )


TABLES = {"3": "fit-table", "4": "candidates", "5": "apply-table", "6": "verify-table"}


@pytest.mark.long
async def test_tables_fit_into_80_columns_though_the_terminal_was_wider(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(160, 48)) as pilot:
        await stream.put_up(bench, tmp_path)
        desk = bench.desk
        desk.study.answer, desk.study.search = stream.fitted(), stream.searched()
        desk.course.before, desk.course.after = stream.verified(600.0, 1), stream.verified(5.0, 2)
        desk.corrections.comparison = stream.compared()
        for key in TABLES:
            await pilot.press(key)
            await pilot.pause()
        await pilot.resize_terminal(80, 24)
        for key, table in TABLES.items():
            await pilot.press(key)
            await pilot.pause(0.3)
            needed, room = columns(bench, table)
            assert 20 < needed <= room


def test_changes_stand_by_effect_and_the_largest_first() -> None:
    changes = stream.compared().proposal.changes
    unknown = replace(changes[0], name="leg9.B_x", sigma=0.0)
    geometry = {change.name for change in changes if change.name.startswith("leg")} | {"leg9.B_x"}
    groups = grouped((*changes, unknown), geometry)
    assert list(groups) == ["", "screw-cyclic-table"]
    first, second = groups.values()
    assert first[0] is unknown  # nobody knows how large it is
    sizes = [abs(change.in_sigmas) for change in first[1:]]
    assert sizes == sorted(sizes, reverse=True)
    assert second[0].name == "screw-cyclic-table.leg6.7"
    rows = [[cell.plain for cell in row] for row in rows_of(groups, wide=False)]
    assert rows[len(first)] == ["screw-cyclic-table", "", "", ""]
    assert rows[len(first) + 1][0] == " leg6.7"


def test_a_gate_that_refuses_stands_first_with_its_reason() -> None:
    gates = stream.compared().gates
    for brief in (False, True):
        lines = gates_text(gates, wide=False, brief=brief).plain.splitlines()
        assert lines[0].split()[:4] == ["✗", "holdout", "1.73", ">"]
        assert lines[1].strip().startswith("RMS of poses that the fit had not seen")
    unknown = GateChecked("chi2", False, float("nan"), 4.0, "", "chi2: of the fit: nan")
    assert "not ≤ 4" in gates_text([unknown], wide=False, brief=False).plain


def test_the_size_of_an_effect_is_its_largest_and_named() -> None:
    found = {
        "effect": "screw-cyclic",
        "parameters": [
            {"name": "screw-cyclic.leg1.sin", "value": 0.001, "sigma": 0.001, "unit": "mm"},
            {"name": "screw-cyclic.leg4.cos", "value": -0.004, "sigma": 0.001, "unit": "mm"},
            {"name": "screw-cyclic.period", "value": 4.0, "sigma": 0.0001, "unit": "mm"},
        ],
    }
    told = largest_text(found, {"screw-cyclic.period"})
    assert told.startswith("leg4.cos -0.0040 ± 0.0010 mm")
    assert largest_text({"effect": "x", "parameters": []}, ()) == ""


def test_a_verification_that_runs_is_told_on_its_screen() -> None:
    picture = Workbench(root=Path()).desk.picture
    assert running_text(picture) == ""
    picture.run, picture.purpose = "running", "verify"
    picture.tell(stream.ev.Progress(12, 159, 600.0))
    assert "step 12 of 159, 10 min left" in running_text(picture)


class Shown(App[None]):
    """A table and a plot."""

    def compose(self) -> ComposeResult:
        yield MissPlot("distances", id="plot")
        yield DataTable[Text](id="table")


async def test_upright_axes_and_long_cells_tell_the_truth() -> None:
    async with Shown().run_test(size=(60, 22)) as pilot:
        plot = pilot.app.query_one(MissPlot)
        plot.styles.height = 11
        await pilot.pause()
        ticks = Spaced(plot).get_ticks(0.0, 840.0)
        steps = {round(b - a, 6) for a, b in pairwise(ticks)}
        assert len(steps) == 1  # none is left out between two others
        assert min(steps) / 840.0 * 8 >= 2.0  # lines between two of them
        table = pilot.app.query_one(DataTable)
        fill(table, ("name", "size"), [("x" * 60, Text("3e-17", "bold"))], most=20)
        assert str(table.get_row_at(0)[0]) == "x" * 19 + "…"
        assert str(table.get_row_at(0)[1]).strip() == "3e-17"


@pytest.mark.long
async def test_the_latest_stage_of_a_write_back_is_in_sight(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("5")
        for number in range(12):
            bench.desk.picture.tell(
                WriteBackStage("write", f"stage {number} of a way that takes more than a line")
            )
            await pilot.pause(0.1)
        bench.desk.picture.say_trouble("a fault", "what to do about it")
        await pilot.pause(0.5)
        stages = bench.screen.query_one("#apply-stages")
        assert stages.scroll_offset.y == stages.max_scroll_y > 0


NARROW = 37
"""Signs of a line of the staircase at 80 columns."""


def test_no_effect_has_its_name_cut_off_in_the_staircase_of_a_narrow_screen() -> None:
    search = stream.searched()
    for effect in catalogue(load_machine("tripod")):
        named = replace(search, stairs=[replace(search.stairs[-1], did=f"+ {effect.id}")])
        lines = str(stairs_text(named, 7, 5)).split("\n")
        assert lines[1].startswith(f"+ {effect.id} ")
        assert max(map(len, lines)) <= NARROW


def test_the_legend_of_the_staircase_is_whole_or_left_out() -> None:
    search = stream.searched()
    for did, whole in (("+ backlash", True), ("+ leg-compliance", False)):
        named = replace(search, stairs=[replace(search.stairs[-1], did=did)])
        head = str(stairs_text(named, 12, 4)).split("\n")[0]
        assert head.endswith(" ░noise █left" if whole else "held out")
        assert len(head) <= 42


def test_how_an_effect_was_called_for_and_what_it_may_be_instead_stay_in_sight() -> None:
    search = stream.searched()
    effect = search.present.effects[-1]
    stair = replace(search.stairs[-1], did=f"+ {effect}", p_value=0.02, weak=True)
    stair = replace(stair, rivals=("screw-pitch", "contact"))
    said = str(found_text(replace(search, stairs=[stair])))
    assert f"{effect}  p 0.02\n" in said
    assert "  ! or screw-pitch, contact?\n  ! weak: chance does so, too" in said
    assert str(found_text(replace(search, stairs=[]))).startswith(f"{effect}\n")


def test_a_ratio_has_no_unit_written_after_it() -> None:
    one = {"name": "contact.leg2", "value": 2e-3, "sigma": 1e-4, "unit": "1"}
    said = largest_text({"effect": "contact", "parameters": [one]}, ())
    assert said == "leg2 0.00200 ± 0.00010"
