"""Scenes at the edge of sense: each runs, or is refused with its place and a way out; never a traceback.

All go through the command line, as a person would run them.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from geomech import cli
from geomech.output import Run

PLATE = """
[[geometry.zones]]
name = "rock"
rectangle = [{left}, {bottom}, {right}, {top}]
{cracks}
[[geometry.edges]]
name = "load:top"
line = [[{left}, {top}], [{right}, {top}]]
[[geometry.edges]]
name = "load:bottom"
line = [[{left}, {bottom}], [{right}, {bottom}]]
[materials.rock]
youngs_modulus_pa = 17e9
poissons_ratio = {nu}
density_kg_m3 = 2200
k_ic_pa_sqrt_m = {k_ic}
[joints.default]
friction_angle_deg = 30.0
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, 0.05e6]
[[loads.tractions]]
edge = "load:bottom"
rate_pa_per_s = [0.0, -0.05e6]
[dda]
time_step_s = 20.0
max_displacement_ratio = 1.0
[growth]
increment_m = {increment}
[run]
end_time_s = 300.0
[output]
interior = false
"""
# A press below the plate, which is fixed.
PRESS = """[[geometry.zones]]
name = "press"
rectangle = [-0.04, -0.07, 0.04, -0.06]
[materials.press]
youngs_modulus_pa = {modulus}
poissons_ratio = 0.21
density_kg_m3 = 1000
[zones.press]
material = "press"
[zones.rock]
material = "rock"
fixed = true
[[geometry.edges]]
name = "load:press"
line = [[-0.04, -0.07], [0.04, -0.07]]
[[loads.tractions]]
edge = "load:press"
rate_pa_per_s = [0.0, 1e6]
"""
MIDDLE = [("middle", [[-0.005, 0.0], [0.005, 0.002]])]


def plate(cracks=MIDDLE, scale=1.0, nu=0.21, k_ic=1e6, increment=2e-3):
    """A plate, 60 × 120 mm times ``scale``, pulled at both ends at 50 kPa/s."""
    drawn = "".join(
        f'[[geometry.cracks]]\nname = "{name}"\npoints = {[[scale * x, scale * y] for x, y in line]}\n'
        for name, line in cracks
    )
    w, h = 0.03 * scale, 0.06 * scale
    size = {"left": -w, "right": w, "bottom": -h, "top": h}
    return PLATE.format(cracks=drawn, nu=nu, k_ic=k_ic, increment=increment * scale, **size)


@pytest.fixture
def run(tmp_path, capfd):
    def does(scene, *more, verb="run"):
        file = tmp_path / "plate.toml"
        file.write_bytes(scene if isinstance(scene, bytes) else scene.encode())
        out = () if verb == "check" else ("--out", str(tmp_path / "out"))
        code = cli.main([verb, str(file), *out, *more])
        shown = "".join(capfd.readouterr())
        assert "Traceback" not in shown
        summary = tmp_path / "out" / "summary.json"
        return code, shown, json.loads(summary.read_text()) if summary.exists() else None

    return does


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ([[-0.03, 0.0], [0.03, 0.002]], "cuts a piece off"),
        ([[-0.04, 0.0], [0.04, 0.002]], "crosses the outline"),
        ([[0.0, 0.0], [0.0, 0.0]], "coincide"),
        ([[0.0, 0.0], [1e-9, 0.0]], "coincide"),
        ([[-0.03, -0.01], [-0.03, 0.01]], "runs along the outline"),
    ],
)
def test_cracks_that_cannot_be_are_refused_where_they_stand(run, line, said):
    code, shown, _ = run(plate([("odd", line)]), verb="check")
    assert code == cli.BAD_INPUT
    assert "plate.toml:5: geometry.cracks[0]" in shown and said in shown and "'odd'" in shown


def test_cracks_on_one_another_are_refused(run):
    code, shown, _ = run(plate([("a", [[0, 0], [0.01, 0]]), ("b", [[0.01, 0], [0, 0]])]), verb="check")
    assert code == cli.BAD_INPUT and "coincide" in shown


@pytest.mark.parametrize("gap", [0.0, 1e-9, -1e-9])
def test_a_crack_that_ends_at_the_outline_to_round_off_is_a_mouth(run, gap):
    """An edge crack has one tip, whichever side of the outline its other end was rounded to."""
    code, shown, _ = run(plate([("edge", [[-0.03 + gap, 0.0], [-0.02, 0.002]])]), verb="check")
    assert code == cli.DONE and "1 crack with 1 tip:" in shown


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(("size", "nu"), [(1 / 120, 0.21), (1e4 / 0.12, 0.21), (1.0, 0.49)])
def test_a_plate_splits_alike_at_any_size(run, size, nu):
    """1 mm, 10 km, nearly incompressible: K of a crack in a plate under tension goes with √size and not with ν, so
    with K_Ic in proportion all split in the same load step: the first beyond K_Ic / √(πa sec(πa/W)) = 7.8 MPa."""
    code, _, summary = run(plate(scale=size, nu=nu, k_ic=1e6 * np.sqrt(size)), "--quiet")
    assert code == cli.DONE and summary["end"] == "split"
    assert summary["first"]["split"]["load_pa"] == pytest.approx(-8e6, rel=1e-9)


@pytest.mark.parametrize(("k_ic", "increment"), [(1e-3, 2e-3), (1e6, 1.0)])
def test_all_at_once_still_ends_with_its_reason(run, k_ic, increment):
    """A toughness of nothing; an increment longer than the specimen."""
    code, _, summary = run(plate(k_ic=k_ic, increment=increment), "--quiet")
    assert code == cli.DONE and summary["end"] == "split" and summary["blocks"] == 2


def test_what_nothing_holds_ends_a_static_run(run):
    """The halves of a torn plate have no equilibrium under their loads: the run ends, and says which flies off."""
    code, _, summary = run(plate(), "--quiet", "--set", "run.stop_at=[]")
    assert code == cli.DONE and summary["end"] == "collapse"
    assert "nothing holds rock/" in summary["first"]["collapse"]["detail"]


def test_no_load_does_nothing(run):
    scene = plate().replace("0.05e6", "0.0")
    code, _, summary = run(scene, "--quiet")
    assert code == cli.DONE and summary["end"] == "end of the scene" and summary["crack_growth_m"] == 0


def test_a_crack_in_a_fixed_block_is_warned_of_and_left_alone(run):
    code, shown, summary = run(plate() + PRESS.format(modulus=2e11))
    assert code == cli.DONE and "warning:" in shown and "'middle' lies in the fixed zone" in shown
    assert summary["crack_growth_m"] == 0 and summary["tips"] == 0


def test_a_press_of_rubber_is_crushed_and_said_to_be(run):
    code, shown, summary = run(plate([]) + PRESS.format(modulus=17e3))
    assert code == cli.FAILED and "press is strained by " in shown and "beyond linear elasticity" in shown
    assert summary["end"].startswith("failed")


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("output.every=0", "output.every"),
        ("output.every=-1", "output.every"),
        ("run.end_time_s=0", "run.end_time_s"),
        ("dda.time_step_s=1e3", "dda.time_step_s"),
        ("materials.rock.poissons_ratio=0.5", "materials.rock.poissons_ratio"),
    ],
)
def test_values_out_of_range_are_refused(run, change, key):
    code, shown, _ = run(plate(), "--set", change, verb="check")
    assert code == cli.BAD_INPUT and key in shown


def test_text_as_windows_saves_it(run):
    """Its line ends, and its mark at the beginning of the file."""
    code, shown, _ = run(("\ufeff" + plate()).replace("\n", "\r\n"), verb="check")
    assert code == cli.DONE, shown


def test_text_in_another_encoding_is_refused(run):
    code, shown, _ = run(b'title = "Pl\xe4ttchen"\n' + plate().encode(), verb="check")
    assert code == cli.BAD_INPUT and "not UTF-8" in shown and "plate.toml" in shown


def test_a_run_folder_that_cannot_be_made(run, tmp_path):
    (tmp_path / "taken").write_text("a file")
    code, shown, _ = run(plate(), "--out", str(tmp_path / "taken"))
    assert code == cli.BAD_INPUT and "taken" in shown and "folder" in shown


def test_a_run_does_not_write_over_its_scene(tmp_path, capfd):
    scene = tmp_path / "scene.toml"
    scene.write_text(plate())
    assert cli.main(["run", str(scene), "--out", str(tmp_path)]) == cli.BAD_INPUT
    assert "overwrite its own scene" in capfd.readouterr().err and scene.read_text() == plate()


def _under_way(tmp_path) -> tuple[subprocess.Popen, Path]:
    """A run in a process of its own that has written ten cycles, and its folder."""
    scene, out = tmp_path / "plate.toml", tmp_path / "out"
    scene.write_text(plate(increment=2e-5))
    process = subprocess.Popen(
        [sys.executable, "-m", "geomech", "run", str(scene), "--out", str(out)], stderr=subprocess.PIPE, text=True
    )
    _wait_for_cycles(process, out, 10)
    return process, out


def _wait_for_cycles(process: subprocess.Popen, out: Path, count: int) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and len(list((out / "vtk").glob("tips_*.vtu"))) < count:
        time.sleep(0.05)
    assert process.poll() is None


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(
    "how", [pytest.param(signal.SIGINT, marks=pytest.mark.other_machines), signal.SIGTERM, signal.SIGKILL]
)
def test_a_broken_off_run_can_be_read(tmp_path, how, interruptible):
    """Ctrl-C and SIGTERM end with exit code 3 and a summary; a kill leaves all but the last cycle's files in good
    order."""
    process, out = _under_way(tmp_path)
    os.kill(process.pid, how)
    _, shown = process.communicate(timeout=20)
    assert "Traceback" not in shown
    if how != signal.SIGKILL:
        assert process.returncode == cli.INTERRUPTED and f"geomech resume {out}" in shown
        assert json.loads((out / "summary.json").read_text())["end"] == "interrupted"
    run = Run(out)
    assert len(run.history["cycle"]) >= 9 and list(run.history["cycle"]) == list(range(len(run.history["cycle"])))


@pytest.mark.other_machines
def test_a_run_in_the_background_heeds_sigterm_alone(tmp_path, in_the_background):
    """What ignores SIGINT from its start, as a shell script's background jobs do, goes on after one; SIGTERM ends
    it."""
    process, out = _under_way(tmp_path)
    os.kill(process.pid, signal.SIGINT)
    _wait_for_cycles(process, out, len(list((out / "vtk").glob("tips_*.vtu"))) + 3)
    os.kill(process.pid, signal.SIGTERM)
    _, shown = process.communicate(timeout=20)
    assert process.returncode == cli.INTERRUPTED and f"geomech resume {out}" in shown
    assert json.loads((out / "summary.json").read_text())["end"] == "interrupted"
