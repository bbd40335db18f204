"""The host store: sets survive whatever happens, or are refused with the way back."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.errors import GateRefused
from app.files.machines import load_machine
from app.hosted.parameters import ParameterSet
from app.hosted.store import HostStore
from drivers.errors import DeviceError, ParameterError, Refused

MACHINE = load_machine("hexapod")


def changed(by: float) -> ParameterSet:
    return ParameterSet({p.name: p.nominal + by for p in MACHINE.parameters})


@pytest.fixture
def store(tmp_path: Path) -> Iterator[HostStore]:
    made = HostStore(tmp_path / "store", MACHINE)
    yield made
    made.close()


def test_a_machine_that_was_never_calibrated_has_its_drawing(store: HostStore) -> None:
    number, held = store.load()
    assert number == 0
    assert held.values == {p.name: p.nominal for p in MACHINE.parameters}


def test_sets_come_back_bit_for_bit_and_older_ones_stay(store: HostStore) -> None:
    store.open()
    assert [store.save(changed(by)) for by in (0.1, 1 / 3)] == [1, 2]
    number, held = store.load()
    assert number == 2
    assert held == changed(1 / 3)
    assert held.checksum != changed(0.1).checksum
    assert store.numbers() == [1, 2]


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: text.replace("230.715", "230.716", 1),
        lambda text: text.replace('"machine": "hexapod"', '"machine": "tripod"'),
        lambda text: "[]",
        lambda text: '{"format": "pkm-host-set/1"}',
        lambda text: text.replace("{", "{\udcff", 1),
    ],
    ids=["torn", "empty", "edited", "other machine", "list", "bare", "not UTF-8"],
)
def test_what_is_torn_or_edited_is_refused_with_the_way_back(store: HostStore, damage) -> None:
    store.open()
    store.save(ParameterSet({**changed(0.0).values, "leg1.L0": 230.715}))
    path = store.path(1)
    text = damage(path.read_text(encoding="utf-8"))
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ParameterError, match=r"0001\.json.*pkmcal undo --to"):
        store.load()
    assert store.save(changed(0.2)) == 2
    assert store.load() == (2, changed(0.2))


def test_a_set_under_anothers_name_is_refused(store: HostStore) -> None:
    store.open()
    store.save(changed(0.1))
    store.save(changed(0.2))
    store.path(1).rename(store.path(3))
    with pytest.raises(ParameterError, match="set 1, under another's name"):
        store.load()


def test_a_draft_that_a_killed_process_left_is_not_a_set(store: HostStore) -> None:
    store.open()
    store.save(changed(0.1))
    store.path(2).with_suffix(".draft").write_text('{"half', encoding="utf-8")
    assert store.load() == (1, changed(0.1))
    assert store.save(changed(0.2)) == 2


def test_a_second_process_is_refused_and_told_who_owns_it(store: HostStore) -> None:
    store.open()
    code = (
        "import sys; from pathlib import Path; from app.errors import GateRefused\n"
        "from app.hosted.store import HostStore; from app.files.machines import load_machine\n"
        "store = HostStore(Path(sys.argv[1]), load_machine('hexapod'))\n"
        "try: store.open()\n"
        "except GateRefused as error: print(error); sys.exit(5)\n"
    )
    words = [sys.executable, "-c", code, str(store.folder)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 5
    assert "in use by process" in done.stdout
    store.close()
    again = HostStore(store.folder, MACHINE)
    again.open()
    again.close()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")
def test_a_process_killed_while_it_stores_leaves_the_old_set_or_the_new_one(
    store: HostStore,
) -> None:
    generator = np.random.default_rng(8)
    seen = set()
    for _ in range(12):
        child = os.fork()
        if child == 0:  # stores until it is killed: value n in set n
            mine = HostStore(store.folder, MACHINE)
            mine.open()
            while True:
                mine.save(changed(float(len(mine.numbers()) + 1)))
        time.sleep(float(generator.uniform(0.002, 0.05)))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        number, held = store.load()
        assert held == (changed(float(number)) if number else ParameterSet.nominal(MACHINE))
        seen.add(number)
    store.open()  # no lock outlives its process
    assert len(seen) > 1


def test_two_stores_of_one_folder_exclude_each_other(store: HostStore) -> None:
    store.open()
    with pytest.raises(GateRefused):
        HostStore(store.folder, MACHINE).open()


def test_a_folder_that_is_a_file_is_said(tmp_path: Path) -> None:
    (tmp_path / "store").write_text("no folder", encoding="utf-8")
    with pytest.raises(DeviceError, match="store = "):
        HostStore(tmp_path / "store", MACHINE).open()


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"leg1.L0": float("nan")}, "no finite number"),
        ({"leg9.L0": 1.0}, "no parameter of the machine"),
    ],
)
def test_sets_that_mean_nothing_are_refused(values: dict[str, float], says: str) -> None:
    with pytest.raises(Refused, match=says):
        ParameterSet({**changed(0.0).values, **values}).checked(MACHINE)
    with pytest.raises(Refused, match="are missing"):
        ParameterSet({"leg1.L0": 230.0}).checked(MACHINE)


def test_the_file_says_what_it_holds(store: HostStore) -> None:
    store.open()
    store.save(changed(0.25))
    said = json.loads(store.path(1).read_text(encoding="utf-8"))
    assert said["format"] == "pkm-host-set/1"
    assert said["number"] == 1
    assert said["values"]["leg1.B_x"] == changed(0.25).values["leg1.B_x"]
