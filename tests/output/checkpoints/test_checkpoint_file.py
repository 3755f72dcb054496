"""What a run goes on from: files whole or not at all, arrays as they were, tables and series cut back."""

import errno
import io
import json
import os
import pickle
from collections import Counter, deque

import numpy as np
import pytest

from geomech import plain_data
from geomech.model import History, JointLaw
from geomech.output import Checkpoints, RunFolder, standard_observers
from geomech.output.checkpoints import checkpoint_file
from geomech.output.checkpoints.checkpoint_file import FilesChanged, NotResumable
from geomech.output.tables.histories import Table
from geomech.output.vtk.vtu import Collection, read_collection

HEAD = {"cycle": 7}


def through(tmp_path, content):
    return checkpoint_file.read(checkpoint_file.write(tmp_path, HEAD, content))


def test_views_go_on_sharing_memory_and_keep_their_layout(tmp_path):
    """Products of arrays round by how these lie in memory, and solvers write into parts of arrays."""
    whole = np.arange(60.0).reshape(6, 10)
    turned = np.asfortranarray(whole)
    rows = np.zeros(4, [("a", float), ("b", int, 2)])
    stored = {
        "whole": whole, "part": whole[1:5:2, ::-3], "turned": turned, "column": turned[:, 3], "field": rows["b"],
        "rows": rows,
        "none": whole[:0], "frozen": whole[2:3].copy(),
    }  # fmt: skip
    stored["frozen"].flags.writeable = False
    back = through(tmp_path, stored)
    for name, value in stored.items():
        assert np.array_equal(back[name], value) and back[name].strides == value.strides, name
    back["whole"][1, 9] = -1.0
    back["rows"]["b"][2] = 5
    assert back["part"][0, 0] == -1.0 and (back["field"][2] == 5).all()
    assert np.shares_memory(back["column"], back["turned"]) and not back["frozen"].flags.writeable
    # What was read is stored and read as well.
    again = through(tmp_path, back)
    again["whole"][1, 9] = -2.0
    assert again["part"][0, 0] == -2.0 and again["part"].strides == stored["part"].strides


def test_zeros_of_an_array_take_no_space(tmp_path):
    """All bits come back: of negative zeros, of the smallest numbers, in either memory order."""
    padded = np.zeros((50, 84, 84))
    padded[:, :12, :12] = np.arange(144.0).reshape(12, 12) - 5
    signs = np.asfortranarray(np.zeros((300, 7), np.float32))
    signs[::9, 2], signs[5, 5], signs[6, 5] = -0.0, 1e-42, np.nan
    odd, none = np.zeros(1001, bool), np.zeros((0, 5))
    stored = {"padded": padded, "part": padded[3], "signs": signs, "odd": odd, "none": none}
    path = checkpoint_file.write(tmp_path, HEAD, stored)
    assert path.stat().st_size < padded.nbytes / 25
    back = checkpoint_file.read(path)
    for name, value in stored.items():
        assert back[name].tobytes("A") == value.tobytes("A") and back[name].strides == value.strides, name
    assert np.shares_memory(back["part"], back["padded"])
    back["padded"][3, 83, 83] = 1.0
    assert back["part"][83, 83] == 1.0


def test_a_store_with_more_words_than_stated_is_refused():
    plain_data.write(file := io.BytesIO(), np.eye(1, 64, 9), plain_data.Allowed())
    stored = bytearray(file.getvalue())
    assert np.array_equal(plain_data.read(io.BytesIO(stored), plain_data.Allowed()), np.eye(1, 64, 9))
    stored[-9] |= 1
    with pytest.raises(plain_data.Broken, match="another number of words"):
        plain_data.read(io.BytesIO(stored), plain_data.Allowed())


def test_one_object_stays_one(tmp_path):
    one = np.ones(3)
    back = through(tmp_path, {"a": one, "b": [one]})
    assert back["a"] is back["b"][0]


def test_all_kinds_of_data_come_back_as_they_were(tmp_path):
    law, ring = JointLaw("bed", friction_angle=0.5), [1]
    ring.append(ring)
    stored = {
        "scalars": [None, True, 3, -0.0, 1e-310, float("inf"), float("nan"), 2 + 1j, b"\x00\xff", "\u00fc\ud800"],
        "numpy": [np.float64(0.1), np.bool_(True), np.dtype([("a", "<f8", (2, 3)), ("b", "<i4")]), np.array(2.0)],
        "held": [{(1, ("a",)): law}, {1, 2}, frozenset({3}), Counter("aab"), deque([1, 2], maxlen=2), law],
        "history": History.constant([1.0, 2.0]),
        ("a", 1): (ring, law, ()),
    }
    back = through(tmp_path, stored)
    assert repr(back["scalars"]) == repr(stored["scalars"])
    assert list(map(repr, back["numpy"])) == list(map(repr, stored["numpy"]))
    assert back["held"] == stored["held"] and back["held"][4].maxlen == 2 and type(back["held"][3]) is Counter
    ring_back, law_back, _ = back["a", 1]
    assert ring_back[1] is ring_back and law_back is back["held"][5] and type(law_back) is JointLaw
    assert list(back) == list(stored) and np.array_equal(back["history"].values, stored["history"].values)


class _Runs:
    """Makes a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_an_old_checkpoint_is_named_and_not_unpickled(tmp_path):
    marker, path = tmp_path / "ran", tmp_path / "cycle_0000007.checkpoint"
    path.write_bytes(json.dumps(HEAD | {"format": 1}).encode() + b"\n" + pickle.dumps(_Runs(marker)))
    assert checkpoint_file.read_header(path) == {"format": 1}
    with pytest.raises(NotResumable, match="of format 1, but this version of geomech reads format 5"):
        checkpoint_file.read(path)
    assert not marker.exists()


def _crafted(tmp_path, classes, nodes):
    """A checkpoint with right sums whose content somebody has made up."""

    def made_up(file, value, allowed):
        text = json.dumps({"root": ["r", 0], "classes": classes, "nodes": nodes}).encode()
        file.write(len(text).to_bytes(8, "little") + text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_data, "write", made_up)
        return checkpoint_file.write(tmp_path, HEAD, None)


@pytest.mark.parametrize(
    ("classes", "nodes"),
    [
        (["subprocess:Popen"], [["o", 0, "args", "true"]]),
        (["os:system"], [["o", 0]]),
        (["geomech.output.run_record:SceneCopy"], [["o", 0]]),
        (["geomech.model.state:np"], [["o", 0]]),
        (["geomech.model.loads.history:Path"], [["o", 0]]),
        (["geomech.coupling.cycle:_go_on"], [["o", 0]]),
        (["geomech.model.problem:Problem"], [["m", ["r", 1], "__init__"], ["o", 0]]),
        (["geomech.model.problem:Problem"], [["s", 0, 1]]),
        (["geomech.model.state:Skip"], [["n", 0, 1]]),
        ([], [["a", 0, "|O", [2], "C", True, None]]),
        ([], [["a", 0, "<f8", [10**14], "C", True, None]]),
        ([], [["v", 1, "<f8", [9], [8], 0, True], ["a", 0, "<f8", [0], "C", True, None]]),
        ([], [["v", 1, "|O", [1], [8], 0, True], ["a", 0, "<f8", [0], "C", True, None]]),
        ([], [["a", 0, "<f8", [10**14], "C", True, -(10**14)]]),
        ([], [["a", 0, "<f8", [2], "C", True, 2]]),
        ([], [["a", 0, "<f8", [0], "C", True, 1.5]]),
        ([], [["z", 1]]),
        ([], [["r", 7]]),
        ([], "no list"),
    ],
)
def test_a_crafted_checkpoint_is_refused(tmp_path, classes, nodes):
    with pytest.raises(NotResumable, match="does not have the content of a checkpoint"):
        checkpoint_file.read(_crafted(tmp_path, classes, nodes))


def test_what_is_no_data_is_not_stored_and_ends_nothing(tmp_path, caplog):
    observer = Checkpoints(every=1)
    observer.on_start(None, tmp_path)
    with open(os.devnull, encoding="utf-8") as file:
        for value in (print, lambda: None, file, np.array([object()]), [_Runs(tmp_path)]):
            assert not observer.write(1, 0.1, value)
    assert caplog.text.count("checkpoint of cycle 1 could not be written") == 5


def test_any_flipped_bit_is_seen(tmp_path):
    """Also in the header, which then would tell of another version that wrote it."""
    before, last = (
        checkpoint_file.write(tmp_path, checkpoint_file.identity() | {"cycle": k}, [k, np.ones(2)]) for k in (1, 2)
    )
    content = last.read_bytes()
    for at in range(len(content)):
        spoiled = bytearray(content)
        spoiled[at] ^= 1 << at % 8
        last.write_bytes(spoiled)
        header, path = next(checkpoint_file.whole(tmp_path))
        assert path == before and header["cycle"] == 1, f"byte {at}"


def test_the_last_two_are_kept_and_a_damaged_one_is_passed_over(tmp_path):
    for cycle in (1, 2, 10):
        last = checkpoint_file.write(tmp_path, {"cycle": cycle}, list(range(cycle)))
    assert [path.name for path in checkpoint_file.found(tmp_path)] == [
        "cycle_0000010.checkpoint",
        "cycle_0000002.checkpoint",
    ]
    content = last.read_bytes()
    spoiled = bytearray(content)
    spoiled[-20] ^= 1
    for bad in (b"", content[:5], content[:-1], content + b"x", bytes(spoiled)):
        last.write_bytes(bad)
        with pytest.raises(NotResumable, match="not a complete checkpoint"):
            checkpoint_file.read(last)
        header, path = next(checkpoint_file.whole(tmp_path))
        assert header["cycle"] == 2 and checkpoint_file.read(path) == [0, 1]


def test_what_cannot_be_written_leaves_what_there_is(tmp_path, monkeypatch, caplog):
    observer = Checkpoints(every=1)
    observer.on_start(None, tmp_path)
    assert observer.write(1, 0.1, "first")

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    assert not observer.write(2, 0.2, "second")
    assert "checkpoint of cycle 2 could not be written: No space left" in caplog.text
    (path,) = (tmp_path / checkpoint_file.FOLDER).iterdir()
    assert checkpoint_file.read(path) == "first"


def test_checkpoints_come_every_so_many_cycles_or_by_the_clock(tmp_path):
    never, often, clock = Checkpoints(every=0), Checkpoints(every=3), Checkpoints()
    due = []
    for observer in (never, often, clock):
        observer.on_start(None, tmp_path)
    for _ in range(7):
        often.on_cycle(None)
        due.append(often.due)
        if often.due:
            often.write(1, 0.0, None)
    assert due == [False, False, True, False, False, True, False]
    assert not never.wanted and not never.due and clock.wanted and not clock.due
    clock._last -= 31.0
    assert clock.due
    with pytest.raises(ValueError, match="or 0 for no checkpoints"):
        Checkpoints(every=-1)


def test_a_table_is_cut_back_to_what_it_was(tmp_path):
    path = tmp_path / "history.csv"
    table = Table(path, ["cycle", "load"])
    table.add([{"cycle": 0, "load": 0.1}, {"cycle": 1, "load": 1e-17}])
    end, then = table.end, path.read_bytes()
    table.add([{"cycle": 2, "load": 0.3}])
    table.close()
    Table.cut_back(path, end).close()
    assert path.read_bytes() == then
    # A column that came later goes as well, and comes back at the same place.
    for _ in range(2):
        table = Table.cut_back(path, end)
        table.add([{"cycle": 2, "load": 0.3, "monitor, x": 0.5}])
        table.close()
        wide = path.read_bytes()
    assert wide.startswith(b'cycle,load,"monitor, x"')
    Table.cut_back(path, end).close()
    assert path.read_bytes() == then


@pytest.mark.parametrize("left", [b"cycle,load\r\n0,0.1\r\n", b"cycle,stress\r\n0,0.1\r\n1,1e-17\r\n", None])
def test_a_table_that_has_lost_rows_is_not_gone_on_with(tmp_path, left):
    path = tmp_path / "history.csv"
    table = Table(path, ["cycle", "load"])
    table.add([{"cycle": 0, "load": 0.1}, {"cycle": 1, "load": 1e-17}])
    end = table.end
    table.close()
    path.unlink() if left is None else path.write_bytes(left)
    with pytest.raises(FilesChanged, match=r"history.csv"):
        Table.cut_back(path, end)


def test_a_series_is_complete_after_every_file(tmp_path):
    path = tmp_path / "blocks.pvd"
    collection = Collection(path)
    assert not path.exists()  # of a series without entries nothing is written
    for k in range(5):
        collection.add(0.1 * k, f"vtk/blocks_{k}.vtu")
        assert len(read_collection(path)) == k + 1
    entries = collection.entries
    written = path.read_bytes()
    collection.close()
    Collection(path, entries[:2]).close()
    assert read_collection(path) == [(at, tmp_path / file) for at, file in entries[:2]]
    again = Collection(path, entries[:2])
    for each in entries[2:]:
        again.add(*each)
    assert path.read_bytes() == written


def test_a_full_disk_leaves_the_series_readable(tmp_path, monkeypatch):
    path = tmp_path / "blocks.pvd"
    collection = Collection(path)
    collection.add(0.0, "vtk/blocks_0.vtu")
    put, room = os.pwrite, path.stat().st_size

    def with_little_room(handle, content, at):
        return put(handle, content[: room - at], at)

    monkeypatch.setattr(os, "pwrite", with_little_room)
    with pytest.raises(OSError, match=r"blocks.pvd"):
        collection.add(1.0, "vtk/blocks_1.vtu")
    assert read_collection(path) == [(0.0, tmp_path / "vtk/blocks_0.vtu")]


def test_a_run_folder_is_cleared_of_a_run_and_of_nothing_else(tmp_path):
    own = ["history.csv", "joints.csv", "summary.json", "tips.csv.part", "checkpoint/cycle_0000012.checkpoint"]
    others = ["notes.csv", "history.csv.bak", "pictures/last.png", "checkpoint/why.txt", "scene.toml"]
    for name in own + others:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    RunFolder().on_start(None, tmp_path)
    assert not any((tmp_path / name).exists() for name in own) and all((tmp_path / name).exists() for name in others)


def test_all_that_write_can_go_on():
    for observer in standard_observers():
        assert callable(observer.memory) and callable(observer.on_resume), type(observer).__name__
