"""One run at a time in a folder, and none over the results of another unless it is asked for."""

import errno
import json
import os
import platform
import subprocess
import sys

import pytest
from small_scenes import block

from geomech import cli
from geomech.output import run_lock
from geomech.output.run_lock import FolderInUse, FolderTaken, RunLock, refuse_results
from geomech.pipeline import overwriting, run
from geomech.resumption import resume
from geomech.scene import load_scene

SCENE = block()
#: A process that has the folder until it is ended.
HOLDS = """
import sys, time
from geomech.output.run_lock import RunLock
with RunLock(sys.argv[1]):
    print("in", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def held(tmp_path):
    """A folder that another process is at work in, and that process."""
    folder = tmp_path / "run"
    other = subprocess.Popen([sys.executable, "-c", HOLDS, str(folder)], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "in\n"
    yield folder, other
    other.kill()
    other.wait()


def test_a_folder_in_use_is_refused_by_name_and_time(held, scene, capsys):
    folder, other = held
    there = f"{folder} is in use by process {other.pid} on {platform.node()} since 20"
    with pytest.raises(FolderInUse, match=there):
        run(load_scene(scene), folder)
    assert [path.name for path in folder.iterdir()] == [run_lock.FILE]
    (folder / "run.log").write_text("")
    with pytest.raises(FolderInUse, match=there):
        resume(folder)
    assert cli.main(["run", str(scene), "--out", str(folder), "--overwrite"]) == cli.BAD_INPUT
    assert cli.main(["resume", str(folder)]) == cli.BAD_INPUT
    assert capsys.readouterr().err.count(there) == 2


def test_a_live_run_with_a_checkpoint_is_in_use_and_not_interrupted(held, scene, capsys):
    folder, other = held
    (folder / "checkpoint").mkdir()
    (folder / "checkpoint" / "cycle_0000003.checkpoint").write_bytes(b"")
    assert cli.main(["run", str(scene), "--out", str(folder)]) == cli.BAD_INPUT
    assert f"{folder} is in use by process {other.pid}" in capsys.readouterr().err


def test_a_folder_left_without_a_word_is_told_and_taken_over(held, scene):
    folder, other = held
    other.kill()
    other.wait()
    assert (folder / run_lock.FILE).is_file()
    run(load_scene(scene), folder)
    assert f"left without being closed by process {other.pid} on" in (folder / "run.log").read_text()
    assert not (folder / run_lock.FILE).exists()


def test_two_runs_started_together_are_one(scene, tmp_path):
    command = [sys.executable, "-m", "geomech", "run", str(scene), "--quiet", "--out", str(tmp_path / "run")]
    both = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    told = sorted((each.communicate()[1], each.returncode) for each in both)
    assert [code for _, code in told] == [cli.DONE, cli.BAD_INPUT]
    # By whichever of the two it comes second.
    assert "is in use by process" in told[1][0] or "holds a run of 4 cycles" in told[1][0]
    assert len((tmp_path / "run" / "history.csv").read_text().splitlines()) == 5


@pytest.mark.parametrize(
    ("left", "refused"),
    [
        ({"process": os.getpid(), "host": platform.node(), "since": "then"}, True),
        ({"process": 2**22 + 1, "host": platform.node(), "since": "then"}, False),
        ({"process": 1, "host": "another", "since": "then"}, True),
    ],
)
def test_where_nothing_can_be_locked_what_is_written_counts(tmp_path, monkeypatch, left, refused):
    import fcntl

    def none(*_):
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))

    monkeypatch.setattr(fcntl, "flock", none)
    with RunLock(tmp_path) as lock:
        assert lock.stale is None
    (tmp_path / run_lock.FILE).write_text(json.dumps(left))
    if refused:
        with pytest.raises(FolderInUse, match=f"process {left['process']} on .* since then.*remove"):
            RunLock(tmp_path).__enter__()
        assert json.loads((tmp_path / run_lock.FILE).read_text()) == left
    else:
        with RunLock(tmp_path) as lock:
            assert "process 4194305" in lock.stale


def test_results_are_not_overwritten_unless_asked_for(scene, tmp_path, capsys):
    out = tmp_path / "run"
    command = ["run", str(scene), "--quiet", "--out", str(out)]
    assert cli.main(command) == cli.DONE
    history = (out / "history.csv").read_bytes()
    assert cli.main([*command, "--set", "run.end_time_s=0.02"]) == cli.BAD_INPUT
    told = capsys.readouterr().err
    assert f"{out} holds a run of 4 cycles (end of the scene)" in told and "--overwrite" in told
    assert f"geomech resume {out}" in told and (out / "history.csv").read_bytes() == history
    assert cli.main([*command, "--set", "run.end_time_s=0.02", "--overwrite"]) == cli.DONE
    assert len((out / "history.csv").read_bytes()) < len(history)
    with pytest.raises(FolderTaken):
        run(load_scene(scene), out, [])
    run(load_scene(scene), out, [], overwrite=True)
    with overwriting():
        run(load_scene(scene), out, [])


def test_a_study_is_refused_before_its_first_run(scene, tmp_path, capsys):
    scene.write_text(SCENE + '[variants.a]\n"run.end_time_s" = 0.02\n[variants.b]\n"run.end_time_s" = 0.03\n')
    command = ["run", str(scene), "--quiet", "--out", str(tmp_path / "runs"), "--variant"]
    assert cli.main([*command, "b"]) == cli.DONE
    assert cli.main(["run", str(scene), "--quiet", "--out", str(tmp_path), "--variant", "all"]) == cli.DONE
    (tmp_path / "a" / "summary.json").unlink()
    for path in (tmp_path / "a" / "checkpoint").iterdir():
        path.unlink()
    before = (tmp_path / "a" / "history.csv").stat().st_mtime_ns
    assert cli.main(["run", str(scene), "--quiet", "--out", str(tmp_path), "--variant", "all"]) == cli.BAD_INPUT
    assert (tmp_path / "a" / "history.csv").stat().st_mtime_ns == before


def test_what_has_come_to_nothing_is_run_over(tmp_path):
    refuse_results([tmp_path, tmp_path / "nowhere"])
    for text in ("", "{", "[]", '{"end": "failed: x"}', '{"cycles": 0}'):
        (tmp_path / "summary.json").write_text(text)
        refuse_results([tmp_path])
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint" / "cycle_0000003.checkpoint").write_bytes(b"")
    with pytest.raises(FolderTaken, match="an interrupted run with a checkpoint"):
        refuse_results([tmp_path])
