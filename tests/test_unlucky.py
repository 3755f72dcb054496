"""Runs where something beside the scene goes wrong: a terminal that is gone, a pipe that is closed, a screen that knows
ASCII alone, a home that cannot be written."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_scenes import block

from geomech import kernel_folder
from geomech.cli import DONE, main
from geomech.output.console.progress import Progress

SCENE = block("Böschung", moving=True)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def geomech(*arguments, **how) -> subprocess.CompletedProcess:
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | how
    return subprocess.run([sys.executable, "-m", "geomech", *map(str, arguments)], check=False, timeout=300, **how)


def test_a_terminal_that_is_gone_ends_the_cycle_and_leaves_a_checkpoint(scene, tmp_path):
    """SIGHUP, as of a dropped ssh, with an error stream that nobody reads any more."""
    out = tmp_path / "run"
    run = subprocess.Popen(
        [sys.executable, "-m", "geomech", "run", scene, "--out", out, "--set", "run.end_time_s=1e5"],
        stderr=subprocess.PIPE, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )  # fmt: skip
    history = out / "history.csv"
    while not (history.is_file() and history.read_bytes().count(b"\n") > 5):
        assert run.poll() is None
        time.sleep(0.1)
    run.stderr.close()
    run.send_signal(signal.SIGHUP)
    assert run.wait(timeout=120) == 3
    assert json.loads((out / "summary.json").read_text())["end"] == "interrupted"
    assert list((out / "checkpoint").iterdir())


def test_nohup_keeps_a_run_alive(scene, tmp_path):
    code = (
        "import os, signal; from geomech import cli; from geomech.cli.verbs.run import prepare_for_a_run;"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN); prepare_for_a_run(); os.kill(os.getpid(), signal.SIGHUP)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_reader_that_has_seen_enough_is_no_error(scene):
    done = subprocess.run(
        f"{sys.executable} -m geomech check {scene} --keys | head -1", shell=True, capture_output=True, check=False
    )
    assert done.stdout.count(b"\n") == 1 and done.stderr == b""


def test_a_screen_that_knows_ascii_alone_is_written_to(scene, tmp_path):
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    words = ["check", str(scene)], ["check", str(scene), "--keys"], ["run", str(scene), "--out", str(tmp_path / "run")]
    code = f"from geomech.cli import main; assert [main(each) for each in {words}] == [0, 0, 0]"
    done = subprocess.run([sys.executable, "-c", code], env=ascii_only, check=False, timeout=300, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert (done.stdout + done.stderr).isascii() and b"B?schung" in done.stdout


def test_an_error_stream_that_cannot_be_written_stops_nothing(scene, tmp_path):
    with open("/dev/full", "w") as full:
        assert geomech("run", scene, "--out", tmp_path / "full", stderr=full).returncode == 0
    closed = f"{sys.executable} -m geomech run {scene} --out {tmp_path / 'closed'} 2>&-"
    assert subprocess.run(closed, shell=True, check=False, capture_output=True).returncode == 0
    for name in ("full", "closed"):
        assert json.loads((tmp_path / name / "summary.json").read_text())["end"] == "end of the scene"


def test_progress_goes_on_without_a_stream(monkeypatch):
    class Gone:
        def write(self, text):
            raise OSError(5, "Input/output error")

    progress = Progress(stream=Gone())
    progress._out = progress.stream
    progress._say("text")
    progress._say("more")
    assert progress._out is None


def test_two_runs_differ_in_times_alone(scene, tmp_path):
    found = []
    for name in ("a", "b"):
        assert main(["run", str(scene), "--out", str(tmp_path / name), "--quiet"]) == DONE
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        for key in ("wall_s", "seconds"):
            summary.pop(key)
        for told in summary["skipped"].values():
            told.pop("saved_s", None)
        found.append(summary)
    assert found[0] == found[1]


@pytest.fixture
def unwritable(tmp_path, monkeypatch):
    """A home below a file, where not even root can write, and a place for what is temporary."""
    (tmp_path / "file").write_text("")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "file" / "home"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("tempfile.tempdir", None)
    return tmp_path


def test_a_home_that_cannot_be_written_is_told_and_gone_round(unwritable):
    code = (
        "import numpy as np\n"
        "from geomech.dda.kinematics.simplex_integration import block_moments\n"
        "print(block_moments(np.array([[0, 0], [1, 0], [1, 1.0]]), np.array([1, 2, 0]), np.array([0, 3]))[0, 0])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.stdout.strip() == "0.5", done.stderr
    folder = unwritable / "tmp" / f"geomech-kernels-{os.getuid()}"
    home = unwritable / "file" / "home" / ".cache" / "geomech" / "kernels"
    assert f"{home} is not writable: compiled kernels are stored in {folder}" in done.stderr
    assert list(folder.glob("*/*.nbc")) and folder.stat().st_mode & 0o777 == 0o700


def test_a_temporary_folder_that_others_can_write_is_not_taken(unwritable):
    """What is kept there is code that is run."""
    shared = unwritable / "tmp" / f"geomech-kernels-{os.getuid()}"
    shared.mkdir()
    shared.chmod(0o777)
    place = kernel_folder.kernel_place.__wrapped__()
    assert place.folder != str(shared) and Path(place.folder).stat().st_mode & 0o077 == 0
    shared.rmdir()
    (unwritable / "tmp" / "elsewhere").mkdir()
    shared.symlink_to(unwritable / "tmp" / "elsewhere")
    assert kernel_folder.kernel_place.__wrapped__().folder != str(shared)


def test_kernels_of_sources_that_are_gone_are_removed(tmp_path):
    for name, source in (("here", __file__), ("gone", tmp_path / "nowhere.py"), ("other", None)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "kernel.nbc").write_bytes(b"code")
        if source is not None:
            (tmp_path / name / kernel_folder.SOURCE).write_text(str(source))
    assert kernel_folder.prune(tmp_path) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["here", "other"]


HALF, BYTE = lambda data: data[: len(data) // 2], lambda data: b"x" + data[1:]


@pytest.mark.parametrize(
    ("suffix", "damage"),
    [
        (".nbi", HALF),
        (".nbc", BYTE),
        pytest.param(".nbi", BYTE, marks=pytest.mark.slow),
        pytest.param(".nbc", HALF, marks=pytest.mark.slow),
    ],
)
def test_a_damaged_kernel_is_compiled_anew(tmp_path, suffix, damage):
    (tmp_path / "scaling.py").write_text(
        "from geomech.compiled import kept\n@kept(nogil=True)\ndef scaled(x):\n    return 2.0 * x\n"
    )
    code = "import scaling; print(scaling.scaled(1.5), sum(scaling.scaled.stats.cache_hits.values()))"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(kernel_folder.__file__).parents[1])])

    def ran() -> tuple[str, str]:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        return done.stdout.strip(), done.stderr

    assert ran()[0] == "3.0 0"
    (path,) = (tmp_path / "kernels").glob(f"*/*{suffix}")
    path.write_bytes(damage(path.read_bytes()))
    answer, told = ran()
    assert answer == "3.0 0" and f"{path} is damaged" in told
    assert ran() == ("3.0 1", "")
