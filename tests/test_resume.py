"""Runs that are broken off and gone on with leave, byte for byte, the files of runs that were not."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from small_scenes import PLATE

from geomech import cli
from geomech.bench.cost.block_scenes import cracked_wall
from geomech.interruption import Interruption
from geomech.model import RunSettings
from geomech.output import (
    Checkpoints,
    Histories,
    JointHistories,
    Run,
    RunLog,
    Series,
    Summary,
    standard_observers,
)
from geomech.output.checkpoints import checkpoint_file
from geomech.pipeline import run, run_problem
from geomech.resumption import Finished, NotResumable, resume
from geomech.scene import load_scene

ROOT = Path(__file__).resolve().parent.parent

pytestmark = pytest.mark.usefixtures("interruptible")

ROCK = """
[materials.rock]
youngs_modulus_pa = 17e9
poissons_ratio = 0.21
density_kg_m3 = 2200
k_ic_pa_sqrt_m = 1e6
"""
#: A plate that is pulled until its crack has cut it in two, and whose parts then part.
SPLIT = (
    'title = "A plate that is torn"\n'
    + PLATE
    + """
[ddm]
elements_per_crack = 2
elements_per_side = 2
grading_layers = 1
[output]
interior_every = 5
"""
)
#: A block with a rough crack on a slope, under weight, shaken, in steps as long as they may be.
SHAKEN = (
    """
title = "Blocks on a shaken slope"
[[geometry.zones]]
name = "slope"
polygon = [[0.0, 0.0], [6.0, 0.0], [0.0, 3.0]]
[[geometry.zones]]
name = "lower"
polygon = [[2.0, 2.0], [3.0, 1.5], [3.5, 2.5], [2.5, 3.0]]
[[geometry.zones]]
name = "upper"
polygon = [[1.0, 2.5], [2.0, 2.0], [2.5, 3.0], [1.5, 3.5]]
[[geometry.cracks]]
name = "flaw"
points = [[2.5, 2.0], [2.8, 2.4]]
"""
    + ROCK
    + """
[zones.slope]
fixed = true
[joints.default]
friction_angle_deg = 24
[joints.flaw]
friction_angle_deg = 20
[cracks.default]
joint = "flaw"
[loads]
gravity_m_s2 = [0.0, -9.81]
[loads.base]
frame = "base"
acceleration_m_s2 = [2.0, 0.0]
frequency_hz = 5.0
[dda]
time_step_s = 0.01
automatic_time_step = true
dynamic_factor = 1.0
max_displacement_ratio = 0.01
[ddm]
elements_per_crack = 2
elements_per_side = 2
[run]
end_time_s = 0.2
stop_at = []
"""
)
#: Stress in the rock, a zone that is dug out, bolts, and a base that moves.
SUPPORTED = (
    """
title = "A block with supports"
[[geometry.zones]]
name = "base"
rectangle = [-2.0, -1.0, 3.0, 0.0]
[[geometry.zones]]
name = "block"
rectangle = [0.0, 0.0, 1.0, 1.0]
[[geometry.zones]]
name = "top"
rectangle = [0.0, 1.0, 1.0, 2.0]
[[geometry.cracks]]
name = "flaw"
points = [[0.4, 0.5], [0.6, 0.55]]
"""
    + ROCK
    + """
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 40
[loads]
gravity_m_s2 = [0.0, -9.81]
[loads.in_situ]
surface_m = 2.0
unit_weight_n_per_m3 = 21582
k0 = 0.0
[[loads.motions]]
zone = "base"
velocity_m_per_s = [0.0, 1e-6]
[[loads.bolts]]
name = "tie"
start = [0.5, 0.7]
end = [0.6, 1.5]
stiffness_n_per_m = 1e8
pretension_n_per_m = 1e4
[[loads.bolts]]
name = "anchor"
start = [0.9, 0.2]
end = [2.0, -0.5]
end_in_ground = true
stiffness_n_per_m = 1e7
start_s = 0.75
[[loads.excavations]]
time_s = 1.5
zones = ["top"]
[dda]
time_step_s = 0.25
max_displacement_ratio = 0.1
[run]
end_time_s = 4.0
stop_at = []
[[monitors]]
name = "roof"
at = [0.5, 1.0]
zone = "block"
"""
)
#: A block that slides down, without cracks: sums by joint are written, and nothing takes long.
SLIDING = (
    """
title = "A block that slides"
[[geometry.zones]]
name = "slope"
polygon = [[0.0, 0.0], [6.0, 0.0], [0.0, 3.0]]
[[geometry.zones]]
name = "block"
polygon = [[2.0, 2.0], [3.0, 1.5], [3.5, 2.5], [2.5, 3.0]]
"""
    + ROCK
    + """
[zones.slope]
fixed = true
[joints.default]
friction_angle_deg = 20
[loads]
gravity_m_s2 = [0.0, -9.81]
[dda]
time_step_s = 0.01
dynamic_factor = 1.0
max_displacement_ratio = 0.01
[run]
end_time_s = 0.12
"""
)
#: Where each is broken off, counted from its middle.
SCENES = {
    "split": (SPLIT, (0, 5)),
    "shaken": (SHAKEN, (0,)),
    "supported": (SUPPORTED, (0,)),
    "sliding": (SLIDING, (-5, 3)),
}


@pytest.fixture
def write(tmp_path):
    def does(text: str) -> Path:
        path = tmp_path / "case.toml"
        path.write_text(text)
        return path

    return does


class Breaks:
    """Asks the run to stop after ``cycle``, as Ctrl-C does."""

    def __init__(self, cycle: int) -> None:
        self.cycle = cycle

    def on_start(self, problem, folder) -> None:
        pass

    def on_cycle(self, cycle) -> None:
        if cycle.number == self.cycle:
            signal.raise_signal(signal.SIGINT)

    def on_end(self, summary, error=None) -> None:
        pass


def broken_off(scene, folder: Path, cycle: int) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(scene, folder, [*standard_observers(scene, quiet=True), Breaks(cycle)], overwrite=True)


def files(folder: Path) -> dict[str, bytes]:
    """Every file of a run, but for how long it took: the log, checkpoints, the summary's seconds."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and name != "run.log" and path.parent.name != checkpoint_file.FOLDER:
            found[name] = path.read_bytes()
    # ParaView's state names the run folder.
    if "view.pvsm" in found:
        found["view.pvsm"] = found["view.pvsm"].replace(str(folder.resolve()).encode(), b"RUN")
    summary = json.loads(found["summary.json"])
    for told in summary.get("skipped", {}).values():
        told.pop("saved_s", None)
    # (A checkpoint is as large as what happens to be kept for the next steps.)
    unlike = ("wall_s", "seconds", "checkpoint_not_kept_mb")
    found["summary.json"] = {key: value for key, value in summary.items() if key not in unlike}
    return found


def differing(a: Path, b: Path) -> list[str]:
    one, other = files(a), files(b)
    return [name for name in sorted({*one, *other}) if one.get(name) != other.get(name)]


@pytest.mark.parametrize("name", SCENES)
def test_a_run_broken_off_and_resumed_leaves_the_same_bytes(name, write, tmp_path):
    """Also from within the growth at one load, and after the cut."""
    text, places = SCENES[name]
    scene = load_scene(write(text))
    last = run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))["cycles"] - 1
    assert last > 10
    for place in places:
        broken_off(scene, tmp_path / "parts", last // 2 + place)
        assert Run(tmp_path / "parts").history["cycle"][-1] == last // 2 + place
        resume(tmp_path / "parts", quiet=True)
        assert differing(tmp_path / "whole", tmp_path / "parts") == [], place


@pytest.mark.slow
@pytest.mark.parametrize("how", ["dda.time_step_s=4", 'run.stepping="events"'])
def test_two_cracks_broken_off_at_every_tenth(how, tmp_path):
    """The published specimen, through growth of all four tips and coalescence, resumed over and over in one folder."""
    scene = load_scene(ROOT / "pipelines" / "two_cracks", [how], "phi_30")
    last = run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))["cycles"] - 1
    observers = standard_observers(scene, quiet=True)
    broken_off(scene, tmp_path / "parts", last // 10)
    for tenth in range(2, 10):
        with pytest.raises(KeyboardInterrupt):
            resume(tmp_path / "parts", (), [*observers, Breaks(tenth * last // 10)])
    resume(tmp_path / "parts", quiet=True)
    assert differing(tmp_path / "whole", tmp_path / "parts") == []


@pytest.mark.slow
def test_a_problem_made_in_python_is_resumed_as_well(tmp_path):
    """A wall of 300 bricks, five of them cracked, without a scene: the blocks' kept factors, and no file to read it
    from."""
    problem = replace(cracked_wall(300, 5), run=RunSettings(end_time=0.2))

    def observers(*more) -> list:
        return [RunLog(), Histories(), JointHistories(), Series(), Checkpoints(every=4), Summary(), *more]

    run_problem(problem, tmp_path / "whole", observers())
    with pytest.raises(KeyboardInterrupt):
        run_problem(problem, tmp_path / "parts", observers(Breaks(9)))
    resume(tmp_path / "parts", (), observers())
    assert differing(tmp_path / "whole", tmp_path / "parts") == []


def test_a_checkpoint_changes_nothing_of_the_run_that_writes_it(write, tmp_path):
    often, never = (load_scene(write(SLIDING), [f"output.checkpoint_every={n}"]) for n in (1, 0))
    for name, scene in (("often", often), ("never", never)):
        run(scene, tmp_path / name, standard_observers(scene, quiet=True))
    assert differing(tmp_path / "often", tmp_path / "never") == ["scene.toml"]
    assert len(checkpoint_file.found(tmp_path / "often" / checkpoint_file.FOLDER)) == checkpoint_file.KEPT
    assert not (tmp_path / "never" / checkpoint_file.FOLDER).exists()
    with pytest.raises(Finished, match="no checkpoint: to continue it, run the scene again"):
        resume(tmp_path / "never", ["run.end_time_s=0.2"])


def test_what_came_after_the_checkpoint_is_dropped(write, tmp_path):
    """Rows, listed and unlisted files and columns from after the checkpoint, as a kill leaves them."""
    scene = load_scene(write(SLIDING), ["output.checkpoint_every=4"])
    run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))
    out = tmp_path / "parts"
    broken_off(scene, out, 9)
    # The one of cycle 8 is what a kill in cycle 10 would have left.
    newest = checkpoint_file.found(out / checkpoint_file.FOLDER)
    assert [checkpoint_file.read_header(path)["cycle"] for path in newest] == [9, 7]
    newest[0].unlink()
    with open(out / "history.csv", "a", encoding="utf-8") as file:
        file.write("10,1e")
    (out / "vtk" / "tips_000123.vtu").write_text("begun")
    (out / "tips.pvd.part").write_text("begun")
    resume(out, quiet=True)
    assert differing(tmp_path / "whole", out) == []


def test_a_damaged_checkpoint_is_named_and_the_one_before_it_used(write, tmp_path, capfd):
    scene = load_scene(write(SLIDING), ["output.checkpoint_every=4"])
    run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))
    out = tmp_path / "parts"
    broken_off(scene, out, 9)
    newest, older = checkpoint_file.found(out / checkpoint_file.FOLDER)
    newest.write_bytes(newest.read_bytes()[:-30] + b"x" * 30)
    resume(out, quiet=True)
    assert f"{newest} is damaged, and is not used" in (out / "run.log").read_text()
    assert differing(tmp_path / "whole", out) == []

    broken_off(scene, out, 9)
    for path in checkpoint_file.found(out / checkpoint_file.FOLDER):
        path.write_bytes(b"")
    assert cli.main(["resume", str(out), "--quiet"]) == cli.DONE
    assert capfd.readouterr().err.splitlines()[-3:] == [
        f"{newest} is damaged, and is not used",
        f"{older} is damaged, and is not used",
        f"{out} holds no other checkpoint: the run begins again",
    ]

    # The checkpoints of a run that has ended, which were not too large to keep.
    last, *_ = left = checkpoint_file.found(out / checkpoint_file.FOLDER)
    for path in left:
        path.write_bytes(b"")
    with pytest.raises(Finished, match=f"has ended .*{re.escape(str(last))} is damaged"):
        resume(out, ["run.end_time_s=9.0"], quiet=True)


def test_a_finished_run_says_so_and_can_be_made_longer(write, tmp_path):
    """What was to end earlier ends as if it had been meant to last as long from the start."""
    path = write(SLIDING)
    long, short = load_scene(path, ["run.end_time_s=0.1"]), load_scene(path, ["run.end_time_s=0.05"])
    for name, scene in (("long", long), ("short", short)):
        run(scene, tmp_path / name, standard_observers(scene, quiet=True))
    with pytest.raises(Finished, match=r"end of the scene.*run.end_time_s=… beyond 0.05"):
        resume(tmp_path / "short")
    resume(tmp_path / "short", ["run.end_time_s=0.1"], quiet=True)
    assert differing(tmp_path / "long", tmp_path / "short") == []
    resume(tmp_path / "short", ["run.end_time_s=0.12", "output.every=5"], quiet=True)
    longer = Run(tmp_path / "short")
    assert longer.history["time"][-1] == pytest.approx(0.12) and longer.scene["run"]["end_time_s"] == 0.12


@pytest.mark.parametrize(
    ("text", "settings", "first", "then"),
    [
        (SLIDING, [], 0.055, 0.1),
        (SHAKEN, [], 0.07, 0.1),
        (SPLIT, ["run.stepping='events'", "output.interior=false"], 140.0, 160.0),
    ],
    ids=["fixed", "automatic", "events"],
)
def test_a_run_made_longer_is_one_that_was_as_long_from_the_start(text, settings, first, then, write, tmp_path):
    """Its first end lies within a step, which the longer run takes whole."""
    path = write(text)
    whole, short = (load_scene(path, [*settings, f"run.end_time_s={end}"]) for end in (then, first))
    for name, scene in (("whole", whole), ("parts", short)):
        run(scene, tmp_path / name, standard_observers(scene, quiet=True))
    assert Run(tmp_path / "parts").history["time"][-1] == pytest.approx(first)
    assert Run(tmp_path / "whole").history["time"].tolist().count(first) == 0
    with pytest.raises(Finished, match=f"beyond {first:g}"):
        resume(tmp_path / "parts")
    resume(tmp_path / "parts", [f"run.end_time_s={then}"], quiet=True)
    assert differing(tmp_path / "whole", tmp_path / "parts") == []


def test_a_load_that_follows_the_cracks_needs_no_checkpoint_at_every_step(tmp_path, monkeypatch):
    """After each growth the load falls, so that the end of the run cannot cut the next step. Broken off between two
    increments, where K at the start of the next step has been solved for, the run goes on to the same bytes."""
    settings = ["growth.increment_m=0.01", "output.interior=false"]
    scene = load_scene(ROOT / "geometry" / "inclined_crack.toml", settings)
    written, write_file = [], checkpoint_file.write

    def counted(folder, header, content):
        written.append(header["cycle"])
        return write_file(folder, header, content)

    monkeypatch.setattr(checkpoint_file, "write", counted)
    last = run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))["cycles"] - 1
    assert last > 8
    assert written == [last]
    broken_off(scene, tmp_path / "parts", last // 2)
    resume(tmp_path / "parts", quiet=True)
    assert differing(tmp_path / "whole", tmp_path / "parts") == []


def test_a_run_that_stopped_goes_on_as_if_never_told_to(write, tmp_path):
    """It stops at the coalescence, before the next pass of growth; told not to, it is the run without that key."""
    path = write(SPLIT)
    short = load_scene(path, ['run.stop_at=["daylighting", "split"]'])
    whole = load_scene(path)
    for name, scene in (("whole", whole), ("parts", short)):
        run(scene, tmp_path / name, standard_observers(scene, quiet=True))
    with pytest.raises(Finished, match=r"daylighting.*run.stop_at=\[\"split\"\]"):
        resume(tmp_path / "parts")
    resume(tmp_path / "parts", ['run.stop_at=["split"]'], quiet=True)
    assert differing(tmp_path / "whole", tmp_path / "parts") == []


def test_another_scene_or_version_is_refused(write, tmp_path, monkeypatch):
    record = tmp_path / "push.csv"
    record.write_text("time [s], ax [m/s2], ay [m/s2]\n0, 0, 0\n1, 2, 0\n")
    text = SLIDING + '[loads.base]\nframe = "base"\nfile = "push.csv"\n'
    scene = load_scene(write(text))
    out = tmp_path / "out"
    broken_off(scene, out, 2)
    with pytest.raises(NotResumable, match=r"joints.default.friction_angle_deg was 20.0, is now 30"):
        resume(out, ["joints.default.friction_angle_deg=30"])
    record.write_text(record.read_text().replace("2, 0", "3, 0"))
    with pytest.raises(NotResumable, match=r"push.csv has changed since the run began"):
        resume(out)
    record.write_text(record.read_text().replace("3, 0", "2, 0"))
    copy = out / "scene.toml"
    kept = copy.read_text()
    copy.write_text(kept.replace("20.0", "25.0"))
    with pytest.raises(NotResumable, match=r"was 20.0, is now 25.0"):
        resume(out)
    copy.write_text(kept)
    known = checkpoint_file.identity()
    for name, told in (("sources", "geomech's sources"), ("numpy", "another numpy"), ("format", "way of storing")):
        monkeypatch.setattr(checkpoint_file, "identity", lambda name=name: {**known, name: "another"})
        with pytest.raises(NotResumable, match=f"{told}.*continue it with the version that wrote it, geomech 0"):
            resume(out)
    monkeypatch.setattr(checkpoint_file, "identity", lambda: known)
    history = (out / "history.csv").read_bytes()
    (out / "history.csv").write_bytes(history[:-5])
    with pytest.raises(NotResumable, match=r"history.csv ends before its row 3"):
        resume(out, quiet=True)
    (out / "history.csv").write_bytes(history)
    assert resume(out, quiet=True)["end"] == "end of the scene"


def test_a_changed_file_that_the_model_includes_is_refused(write, tmp_path):
    """A model is all files that it reads, one in another."""
    (tmp_path / "sizes.geo").write_text("width = 3;\n")
    (tmp_path / "parts.geo").write_text('Include "sizes.geo";\nheight = 0.5;\n')
    model = tmp_path / "ground.geo"
    model.write_text(
        'Include "parts.geo";\n// Include "none.geo";\nSetFactory("OpenCASCADE");\n'
        "Rectangle(1) = {0, -1, 0, width, 1};\nRectangle(2) = {1, 0, 0, 1, height};\nCoherence;\n"
        'Physical Surface("slope") = {1};\nPhysical Surface("block") = {2};\n'
    )
    rest = SLIDING.split("[materials.rock]")[1]
    text = 'title = "included"\n[geometry]\nmodel = "ground.geo"\n[materials.rock]' + rest
    out = tmp_path / "out"
    broken_off(load_scene(write(text)), out, 2)
    for name, was, now in (("sizes.geo", "3", "4"), ("parts.geo", "0.5", "0.6"), ("ground.geo", "{1, 0", "{0.5, 0")):
        file = tmp_path / name
        begun = file.read_text()
        file.write_text(begun.replace(was, now))
        with pytest.raises(NotResumable, match=rf"{name} has changed since the run began"):
            resume(out)
        file.write_text(begun)
    resume(out, quiet=True)


def test_what_is_no_run_is_reported(write, tmp_path, capfd):
    out = tmp_path / "out"
    assert cli.main(["resume", str(out)]) == cli.BAD_INPUT and "there is no run folder" in capfd.readouterr().err
    out.mkdir()
    assert cli.main(["resume", str(out)]) == cli.BAD_INPUT and "holds no run" in capfd.readouterr().err
    # Without a checkpoint it begins again, and finished it says so.
    scene = load_scene(write(SLIDING), ["output.checkpoint_every=0", "run.end_time_s=0.04"])
    with pytest.raises(KeyboardInterrupt):
        run(scene, out, [*standard_observers(scene, quiet=True), _At(3, KeyboardInterrupt())])
    assert cli.main(["resume", str(out), "--quiet"]) == cli.DONE
    assert "holds no checkpoint yet: the run begins again" in capfd.readouterr().err
    assert Run(out).history["cycle"].tolist() == [0, 1, 2, 3, 4]
    assert cli.main(["resume", str(out)]) == cli.DONE and "the run has ended" in capfd.readouterr().err


def test_an_ended_run_keeps_no_checkpoint_above_the_size_that_is_asked_for(write, tmp_path):
    ended = ["run.end_time_s=0.04"]
    for kept_mb, there in ((16, True), (0.001, False)):
        scene, out = load_scene(write(SLIDING), [*ended, f"output.checkpoint_kept_mb={kept_mb}"]), tmp_path / f"{there}"
        summary = run(scene, out, standard_observers(scene, quiet=True))
        assert bool(list((out / "checkpoint").glob("*.checkpoint"))) == there
        assert ("checkpoint_not_kept_mb" in summary) == (not there)
    # One that was broken off keeps its own, whatever its size.
    scene, out = (
        load_scene(write(SLIDING), ["output.checkpoint_kept_mb=0", "output.checkpoint_every=1"]),
        tmp_path / "off",
    )
    with pytest.raises(KeyboardInterrupt):
        run(scene, out, [*standard_observers(scene, quiet=True), _At(3, KeyboardInterrupt())])
    assert list((out / "checkpoint").glob("*.checkpoint"))


class _At(Breaks):
    """Fails after ``cycle``."""

    def __init__(self, cycle: int, error: BaseException) -> None:
        super().__init__(cycle)
        self.error = error

    def on_cycle(self, cycle) -> None:
        if cycle.number == self.cycle:
            raise self.error


@pytest.mark.other_machines
def test_a_second_interrupt_stops_at_once(write, tmp_path):
    scene, out = load_scene(write(SLIDING), ["output.checkpoint_every=2"]), tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run(
            scene,
            out,
            [*standard_observers(scene, quiet=True), Breaks(5), Breaks(5), _At(5, AssertionError("too late"))],
        )
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert checkpoint_file.read_header(checkpoint_file.found(out / checkpoint_file.FOLDER)[0])["cycle"] == 3
    assert resume(out, quiet=True)["end"] == "end of the scene"


@pytest.mark.other_machines
def test_a_cycle_that_lasts_is_broken_off(write, tmp_path, monkeypatch):
    """Nobody waits minutes for a cycle to end; what was stored goes on to the end of the scene."""

    class Lasts(Breaks):
        def on_cycle(self, cycle) -> None:
            super().on_cycle(cycle)
            if cycle.number == self.cycle:
                time.sleep(60.0)

    monkeypatch.setattr("geomech.pipeline.Interruption", partial(Interruption, patience=0.2))
    scene, out = load_scene(write(SLIDING), ["output.checkpoint_every=2"]), tmp_path / "out"
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        run(scene, out, [*standard_observers(scene, quiet=True), Lasts(5)])
    assert time.monotonic() - began < 50.0
    assert {signal.getsignal(n) for n in (signal.SIGINT, signal.SIGALRM)} == {
        signal.default_int_handler, signal.SIG_DFL,
    }  # fmt: skip
    assert json.loads((out / "summary.json").read_text())["end"] == "interrupted"
    assert resume(out, quiet=True)["end"] == "end of the scene"


def test_what_is_stored_after_an_interrupt_may_take_its_time():
    with Interruption(patience=0.05) as interruption:
        os.kill(os.getpid(), signal.SIGINT)
        interruption.wait()
        time.sleep(0.2)
    assert interruption.asked


def test_a_full_disk_is_told_and_what_was_written_is_kept(write, tmp_path, monkeypatch, capfd):
    """As the file system says it, in the middle of a run; with room again the run goes on to the same bytes."""
    from geomech.output.vtk import vtu

    path, out, whole = write(SLIDING), tmp_path / "out", tmp_path / "whole"
    run(load_scene(path), whole, standard_observers(load_scene(path), quiet=True))
    put, count = os.write, [0]

    def fills_up(handle, content):
        count[0] += 1
        if count[0] > 40:
            put(handle, bytes(content)[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return put(handle, content)

    monkeypatch.setattr(vtu.os, "write", fills_up)
    code = cli.main(["run", str(path), "--out", str(out), "--set", "output.checkpoint_every=2"])
    shown = capfd.readouterr().err
    assert code == cli.FAILED and "no space left on device" in shown and ".vtu" in shown
    assert f"geomech resume {out}" in shown
    monkeypatch.undo()
    broken = Run(out)
    assert len(broken.history) >= 8 and all(file.stat().st_size for _, file in broken.series("blocks"))
    assert cli.main(["resume", str(out), "--quiet"]) == cli.DONE
    assert differing(whole, out) == ["scene.toml"]


def _killed(out: Path, command: list[str], random: np.random.Generator) -> bool:
    """Kill ``command``, which writes to ``out``, with SIGKILL at a random moment; whether it was still running."""
    process = subprocess.Popen(
        [sys.executable, "-m", "geomech", *command, "--quiet"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    # Most of a start goes by before anything is written; so many changes of these files later it is at some cycle.
    watched, seen = (out / "run.log", out / "history.csv"), None
    for _ in range(random.integers(16)):
        before = seen
        while process.poll() is None and seen == before:
            time.sleep(0.001)
            seen = [path.stat()[6:9] if path.is_file() else None for path in watched]
    time.sleep(random.uniform(0.0, 0.06))
    process.kill()
    _, shown = process.communicate()
    assert "Traceback" not in shown and process.returncode in (0, -signal.SIGKILL), shown
    return process.returncode != 0


def _killed_and_resumed(path: Path, tmp_path: Path, kills: int, seed: int) -> None:
    """One folder, killed again and again; after each kill all that was written can be read."""
    scene = load_scene(path)
    run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))
    random, out = np.random.default_rng(seed), tmp_path / "out"
    begin = ["run", str(path), "--out", str(out), "--overwrite"]
    command, furthest = begin, 0
    for _ in range(kills):
        if not _killed(out, command, random):
            assert differing(tmp_path / "whole", out) == []
            command = begin
        elif (out / "run.log").is_file() and (out / "scene.toml").is_file():
            furthest = max(furthest, _readable(out))
            command = ["resume", str(out)]
    assert furthest > 1
    subprocess.run([sys.executable, "-m", "geomech", *command, "--quiet"], check=True)
    assert differing(tmp_path / "whole", out) == []


def _readable(out: Path) -> int:
    """How many cycles can be read; all of those begun can."""
    import pyvista

    if not (out / "history.csv").is_file():
        return 0
    broken = Run(out)
    numbers = broken.history["cycle"].tolist()
    assert numbers == list(range(len(numbers)))
    listed = {name: broken.grids(name) for name in ("blocks", "cracks", "tips", "contacts", "interior")}
    for grids in listed.values():
        assert all(file.stat().st_size > 0 for file in grids.values())
    # No cycle that the history has is missing in the series, but for the one that was being written.
    assert len(numbers) - len(listed["blocks"]) <= 1 and listed["blocks"].keys() <= {*numbers, len(numbers)}
    for grids in listed.values():
        if grids:
            pyvista.read(grids[max(grids)])
    newest = next(checkpoint_file.whole(out / checkpoint_file.FOLDER), None)
    if newest is not None:
        assert newest[0]["cycle"] < len(numbers)
    return len(numbers)


@pytest.mark.slow
def test_kills_lose_nothing(write, tmp_path):
    text = SLIDING.replace("end_time_s = 0.12", "end_time_s = 0.3") + "[output]\ncheckpoint_every = 3\n"
    _killed_and_resumed(write(text), tmp_path, 5, 1)


@pytest.mark.slow
def test_a_hundred_kills_lose_nothing(write, tmp_path):
    _killed_and_resumed(write(SPLIT + "checkpoint_every = 3\n"), tmp_path, 100, 2)


@pytest.mark.other_machines
def test_signals_are_left_alone_elsewhere(write, tmp_path):
    """A run in another thread than the main one changes no handler; a run without checkpoints neither."""
    scene = load_scene(write(SLIDING), ["run.end_time_s=0.02"])
    seen = []

    class Sees(Breaks):
        def on_cycle(self, cycle) -> None:
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run, args=(scene, tmp_path / "a", [Checkpoints(), Sees(0)]))
    thread.start()
    thread.join()
    run(scene, tmp_path / "b", [Checkpoints(every=0), Sees(0)])
    assert len(seen) == 6 and set(seen) == {signal.default_int_handler}


@pytest.mark.other_machines
def test_an_ignored_interrupt_stays_ignored(write, tmp_path, in_the_background):
    """A run that a script has put in the background is not broken off by the Ctrl-C meant for another program."""
    scene = load_scene(write(SLIDING), ["run.end_time_s=0.06"])
    ended = run(scene, tmp_path / "out", [*standard_observers(scene, quiet=True), Breaks(2)])
    assert ended["end"] == "end of the scene"
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_time_spent_goes_on(write, tmp_path):
    scene = load_scene(write(SLIDING), ["run.end_time_s=0.06"])
    broken_off(scene, tmp_path / "out", 2)
    before = json.loads((tmp_path / "out" / "summary.json").read_text())["wall_s"]
    began = time.perf_counter()
    after = resume(tmp_path / "out", quiet=True)["wall_s"]
    assert before * 0.5 < after < before + time.perf_counter() - began


def test_a_run_broken_off_between_changes_of_faces_is_gone_on_with(tmp_path):
    """What contacts and faces did before is known again: between the first slip of two joints and their sliding all
    along."""
    scene = load_scene(ROOT / "pipelines" / "joint_shear", ["run.end_time_s=31", "output.interior=false"])
    last = run(scene, tmp_path / "whole", standard_observers(scene, quiet=True))["cycles"] - 1
    kinds = Run(tmp_path / "whole").events["kind"].tolist()
    assert kinds == ["slip", "slip", "sliding", "sliding"]
    broken_off(scene, tmp_path / "parts", last - 2)
    resume(tmp_path / "parts", quiet=True)
    assert differing(tmp_path / "whole", tmp_path / "parts") == []
