"""The command line as a user meets it: verbs, exit codes, messages."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from geomech import __version__
from geomech.cli import BAD_INPUT, DONE, FAILED, default_folder, main
from geomech.cli.verb import check_folder, check_writable
from geomech.installing import doctor

VERBS = ("check", "run", "safety", "render", "report", "doctor")
SPECIMEN = """
title = "A plate"
[geometry]
zones = [{ name = "rock", rectangle = [-0.03, -0.06, 0.03, 0.06] }]
cracks = [{ name = "flaw", centre = [0.0, 0.0], length_m = 0.01, angle_deg = 45.0 }]
edges = [
    { name = "load:top", line = [[-0.03, 0.06], [0.03, 0.06]] },
    { name = "load:bottom", line = [[-0.03, -0.06], [0.03, -0.06]] },
]
[materials.rock]
youngs_modulus_pa = 17e9
poissons_ratio = 0.21
density_kg_m3 = 2200
k_ic_pa_sqrt_m = 2e6
[zones.rock]
material = "rock"
[loads]
leading_edge = "load:top"
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, -0.2e6]
[[loads.tractions]]
edge = "load:bottom"
rate_pa_per_s = [0.0, 0.2e6]
[run]
end_time_s = 3.0
[variants.steep]
"geometry.cracks.0.angle_deg" = 60.0
"""


@pytest.fixture
def scene(tmp_path) -> Path:
    (tmp_path / "plate.toml").write_text(SPECIMEN)
    return tmp_path / "plate.toml"


@pytest.fixture
def finished(tmp_path) -> Path:
    sys.path.insert(0, str(Path(__file__).parent / "output"))
    import synthetic_run

    from geomech.output import Histories, Series, Summary

    synthetic_run.write(tmp_path / "runs" / "one", [Histories(), Series(interior_every=0), Summary()])
    return tmp_path / "runs" / "one"


def test_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.strip() == f"geomech {__version__}"


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(verb, capsys):
    with pytest.raises(SystemExit) as ended:
        main([verb, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert f"example:\n  geomech {verb}" in text


@pytest.mark.parametrize("arguments", [[], ["frobnicate"], ["run"], ["render", "x", "--width", "wide"]])
def test_wrong_usage_ends_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == BAD_INPUT


def test_help_imports_nothing_heavy():
    heavy = "numpy scipy numba gmsh vtkmodules pyvista shapely pydantic matplotlib"
    code = (
        "import sys, geomech.cli\n"
        "try: geomech.cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        f"loaded = [m for m in {heavy!r}.split() if m in sys.modules]\n"
        "assert not loaded, loaded\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_check_tells_what_is_there(scene, capsys):
    assert main(["check", str(scene)]) == DONE
    out = capsys.readouterr().out
    assert "A plate: 1 block, 1 crack with 2 tips: no errors" in out
    assert "0.06 × 0.12 m, 1 zone" in out and "flaw: 10 mm, 2 tips" in out and "K_Ic 2 MPa√m" in out
    assert "variants: steep" in out


def test_check_of_all_variants(scene, capsys):
    assert main(["check", str(scene), "--variant", "all"]) == DONE
    assert "A plate, steep" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["check", "run"])
def test_warnings_are_said_in_a_line_each_and_once(verb, scene, tmp_path, monkeypatch, capsys):
    import geomech.pipeline

    monkeypatch.setattr(geomech.pipeline, "run", lambda scene, out, observers: None)
    scene.write_text(SPECIMEN.replace("2e6\n", "2.0\n") + '[variants.flat]\n"geometry.cracks.0.angle_deg" = 0.0\n')
    assert main([verb, str(scene), "--variant", "all"]) == DONE
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and told[0].startswith("warning: ") and "k_ic_pa_sqrt_m" in told[0]
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(scene), "--quiet"]) == DONE
    assert capsys.readouterr().err == ""


def test_check_lists_the_keys(scene, capsys):
    assert main(["check", str(scene), "--keys"]) == DONE
    assert "youngs_modulus_pa" in capsys.readouterr().out


def test_bad_scene_ends_with_2_and_all_its_errors(scene, capsys):
    wrong = SPECIMEN.replace("poissons_ratio = 0.21", "poissons_ratio = 0.7").replace("[run]", "[run]\nfast = true")
    scene.write_text(wrong)
    assert main(["check", str(scene)]) == BAD_INPUT
    told = capsys.readouterr().err
    assert "poissons_ratio" in told
    assert "fast" in told
    assert "2 errors; nothing was run" in told
    assert "plate.toml" in told
    assert "Traceback" not in told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "nowhere.toml"], "nowhere.toml"),
        (["run", "nowhere.toml"], "nowhere.toml"),
        (["render", "nowhere"], "there is no folder nowhere"),
        (["report", "nowhere"], "there is no folder nowhere"),
    ],
)
def test_missing_input_ends_with_2(arguments, message, capsys):
    assert main(arguments) == BAD_INPUT
    assert message in capsys.readouterr().err


def test_unknown_variant_names_the_known_ones(scene, capsys):
    assert main(["run", str(scene), "--variant", "flat"]) == BAD_INPUT
    assert "no variant flat; the scene has steep" in capsys.readouterr().err


def test_wrong_override_ends_with_2(scene, capsys):
    assert main(["check", str(scene), "--set", "growth.criterium=mts"]) == BAD_INPUT
    assert "criterion" in capsys.readouterr().err


def test_run_hands_scene_folder_and_observers_over(scene, tmp_path, monkeypatch):
    """One folder a run: --out itself for one variant, a sub-folder each for several."""
    import geomech.pipeline

    ran = []

    def runs(scene, out, observers):
        ran.append((scene.title, out, len(observers)))

    monkeypatch.setattr(geomech.pipeline, "run", runs)
    out = tmp_path / "out"
    assert main(["run", str(scene), "--out", str(out), "--quiet"]) == DONE
    assert main(["run", str(scene), "--out", str(out), "--variant", "steep"]) == DONE
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(scene), "--variant", "all"]) == DONE
    assert [entry[1] for entry in ran] == [out, out, Path("outputs/plate/steep")]
    assert all(entry[0] == "A plate" and entry[2] >= 5 for entry in ran)


def test_failed_run_ends_with_1_and_tells_why(scene, tmp_path, monkeypatch, capsys):
    import geomech.pipeline

    def fails(scene, out, observers):
        raise ArithmeticError("no equilibrium at t = 2 s")

    monkeypatch.setattr(geomech.pipeline, "run", fails)
    assert main(["run", str(scene), "--out", str(tmp_path)]) == FAILED
    told = capsys.readouterr().err
    assert "no equilibrium at t = 2 s" in told
    assert "Traceback" not in told
    with pytest.raises(ArithmeticError):
        main(["--debug", "run", str(scene), "--out", str(tmp_path)])


def test_pipeline_folder_runs_its_script(tmp_path):
    """A folder with a run.py is handed all that the command line says."""
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "run.py").write_text(
        "def main(folder, out, overrides, variants, quiet):\n"
        "    (folder / 'said.txt').write_text(repr((out.name, overrides, variants, quiet)))\n"
    )
    wishes = ["--out", str(tmp_path / "o"), "--set", "a.b=1", "--variant", "x", "--quiet"]
    assert main(["run", str(tmp_path / "study"), *wishes]) == DONE
    assert (tmp_path / "study" / "said.txt").read_text() == repr(("o", ["a.b=1"], ["x"], True))


@pytest.mark.parametrize(
    ("asked", "handed"), [([], []), (["--variant", "all"], ["steep", "flat"]), (["--variant", "flat"], ["flat"])]
)
def test_pipeline_scripts_are_handed_variants_by_name(tmp_path, asked, handed):
    study = tmp_path / "study"
    study.mkdir()
    (study / "scene.toml").write_text(SPECIMEN + '[variants.flat]\n"geometry.cracks.0.angle_deg" = 0.0\n')
    (study / "run.py").write_text(
        "def main(folder, out, overrides, variants, quiet):\n    (folder / 'said.txt').write_text(repr(variants))\n"
    )
    assert main(["run", str(study), *asked]) == DONE
    assert (study / "said.txt").read_text() == repr(handed)
    assert main(["run", str(study), "--variant", "stepe"]) == BAD_INPUT


def test_all_variants_of_a_folder_that_names_none(tmp_path, capsys):
    (tmp_path / "run.py").write_text("def main(folder, out, overrides, variants, quiet): ...\n")
    assert main(["run", str(tmp_path), "--variant", "all"]) == BAD_INPUT
    assert "holds no scene.toml" in capsys.readouterr().err


def test_default_folder_is_named_after_the_scene():
    assert default_folder(Path("pipelines/two_cracks")) == Path("outputs/two_cracks")
    assert default_folder(Path("pipelines/two_cracks/scene.toml")) == Path("outputs/two_cracks")
    assert default_folder(Path("mine/plate.toml")) == Path("outputs/plate")


def test_report_of_a_folder_of_runs(finished, capsys):
    assert main(["report", str(finished.parent), "--no-page"]) == DONE
    header, row = capsys.readouterr().out.splitlines()
    assert header.split()[:2] == ["run", "end"]
    assert row.startswith("one")
    assert "0.60" in row  # initiation at 3 steps of 0.2 MPa
    assert main(["report", str(finished), "--csv"]) == DONE
    (read,) = csv.DictReader(io.StringIO(capsys.readouterr().out))
    assert float(read["initiation MPa"]) == pytest.approx(0.6, rel=1e-12)
    assert read["coalescence MPa"] == ""


def test_render_prints_what_it_drew(finished, capsys):
    assert main(["render", str(finished), "--no-gif", "--width", "300", "--component", "xx"]) == DONE
    paths = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert paths[0].name == "specimen.png"
    assert all(path.is_file() for path in paths)
    assert not any(path.suffix == ".gif" for path in paths)


@pytest.mark.parametrize(
    ("wishes", "message"),
    [(["--component", "foo"], "there are xx, yy, zz, xy, principal_max"), (["--width", "3"], "give at least 64")],
)
def test_render_refuses_what_it_cannot_draw(finished, wishes, message, capsys):
    assert main(["render", str(finished), *wishes]) == BAD_INPUT
    assert message in capsys.readouterr().err
    assert not (finished / "pictures").exists()


def test_render_of_a_folder_of_runs_names_them(finished, capsys):
    assert main(["render", str(finished.parent)]) == BAD_INPUT
    assert f"runs below it: {finished}" in capsys.readouterr().err


def test_a_failure_is_told_once(scene, tmp_path, monkeypatch, capsys):
    import geomech.coupling

    def fails(coupling):
        raise ArithmeticError("no equilibrium at t = 2 s")
        yield

    monkeypatch.setattr(geomech.coupling.Coupling, "cycles", fails)
    assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == FAILED
    told = capsys.readouterr().err
    assert told.count("no equilibrium") == 1 and "stopped before the first cycle" in told
    assert "no equilibrium" in (tmp_path / "out" / "run.log").read_text()


def test_a_run_folder_that_cannot_be_is_told_in_a_line(scene, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["run", str(scene), "--out", str(tmp_path / "file" / "run")]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert str(tmp_path / "file") in line and "not a directory" in line


def test_doctor_says_how_to_mend(monkeypatch, capsys):
    broken = doctor.Check("gmsh", False, "missing shared libraries: libGLU.so.1", doctor.apt_line(["libGLU.so.1"]))
    monkeypatch.setattr(doctor, "examine", lambda: [doctor.Check("python", True, "3.12"), broken])
    assert main(["doctor"]) == FAILED
    out = capsys.readouterr().out
    assert "FAIL gmsh" in out
    assert "apt-get install -y libglu1-mesa" in out


def test_doctor_reads_what_loaders_say():
    """The messages are glibc's and ldd's own."""
    loader = "OSError: libGLU.so.1: cannot open shared object file: No such file or directory"
    assert doctor.missing_libraries(loader) == ["libGLU.so.1"]
    ldd = "\tlibXcursor.so.1 => not found\n\tlibc.so.6 => /lib/libc.so.6 (0x0)\n\tlibXft.so.2 => not found\n"
    assert doctor.missing_libraries(ldd) == ["libXcursor.so.1", "libXft.so.2"]
    assert doctor.apt_line(["libXcursor.so.1", "libXft.so.2"]) == "apt-get install -y libxcursor1 libxft2"
    assert "libodd.so.9" in doctor.apt_line(["libodd.so.9"])


def test_doctor_survives_a_library_that_takes_its_process_down():
    check = doctor.check_import("gmsh", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "mend it")
    assert not check.good
    assert check.remedy == "mend it"


def test_doctor_names_a_library_that_is_missing():
    code = "import ctypes; ctypes.CDLL('libnever-there.so.7')"
    check = doctor.check_import("something", code, "")
    assert "libnever-there.so.7" in check.found


def test_a_scene_runs_from_the_command_line_to_its_folder(tmp_path, capsys):
    """Two load steps on the two-crack specimen, nothing made up: the K of the files is that of the isolated specimen.

    The reference factors were computed apart, with elements of order 8 on the plate under uniform end stress, and have
    five digits; the scene's default elements of order 4 keep four of them.
    """
    import numpy as np

    from geomech.output import Run
    from geomech.reference.specimens.two_cracks import OPEN_SLOT_K_I, OPEN_SLOT_K_II

    scene = Path(__file__).parents[1] / "pipelines" / "two_cracks" / "scene.toml"
    out = tmp_path / "out"
    assert main(["run", str(scene), "--variant", "phi_0", "--set", "run.end_time_s=2.0", "--out", str(out)]) == DONE
    assert "Two cracks" in capsys.readouterr().err
    run = Run(out)
    assert {path.name for path in out.iterdir()} >= {
        "scene.toml", "view.py", "blocks.pvd", "cracks.pvd", "tips.pvd", "contacts.pvd", "interior.pvd",
        "history.csv", "tips.csv", "events.csv", "summary.json", "run.log",
    }  # fmt: skip
    last = run.tips[run.tips["cycle"] == run.history["cycle"][-1]]
    assert last["load"][0] == pytest.approx(0.4e6, rel=1e-6)
    order = np.lexsort([last["y"], last["crack"]])  # crack 1, then crack 2, lower tip first
    assert np.allclose(last["K_I"][order] / 0.4e6, OPEN_SLOT_K_I[0], rtol=1e-4)
    assert np.allclose(last["K_II"][order] / 0.4e6, OPEN_SLOT_K_II[0], rtol=1e-4)
    assert run.summary["cycles"] == len(run.history)
    work = run.summary["crack_solver"]
    assert work["boundary_factorisations"] == work["crack_factorisations"] == 1 <= work["solutions"]
    trust = run.summary["crack_trust"]
    assert trust["residual"] < 1e-5 and 1 < trust["condition"] < 1e4
    off = max(np.abs(last["K_I"][order] / 0.4e6 - OPEN_SLOT_K_I[0]) / abs(OPEN_SLOT_K_I[0][0]))
    assert 0.5 * off < trust["k_error"] < 1e-4 and trust["k_error_block"]
    # Away from the flaws the rock carries the load, in the files too.
    grid = run.grid("interior", int(run.history["cycle"][-1]))
    corner = np.hypot(*(grid.points[:, :2] - (0.02, 0.05)).T).argmin()
    assert grid["stress"][corner, 1] == pytest.approx(-0.4e6, rel=0.05)


SLOPE = """
title = "A slab on a slope"
[geometry]
zones = [
    { name = "base", polygon = [[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]] },
    { name = "slab", polygon = [[4.0, 2.0], [6.0, 3.0], [6.0, 4.0], [4.0, 3.0]] },
]
[materials.rock]
youngs_modulus_pa = 50e9
poissons_ratio = 0.2
density_kg_m3 = 2600
[zones.base]
fixed = true
[joints.default]
friction_angle_deg = 35.0
[loads]
gravity_m_s2 = [0.0, -9.81]
[dda]
time_step_s = 0.01
[run]
end_time_s = 1.0
"""


def test_safety_prints_trials_and_mechanism(tmp_path, capsys):
    scene, answer = tmp_path / "slope.toml", tmp_path / "safety.json"
    scene.write_text(SLOPE)
    assert main(["safety", str(scene), "--out", str(answer)]) == DONE
    out, err = capsys.readouterr()
    # tan φ / tan α
    factor = math.tan(math.radians(35)) / 0.5
    assert f"factor of safety {factor:.4f}" in out
    assert "slab: 1.00 of the fastest, towards -153°" in out
    # The search begins near the largest factor with admissible forces: trials at rest below the factor, motion above it.
    tried = re.findall(r"F = ([0-9.]+): (at rest|keeps moving)", err)
    assert {word for f, word in tried if float(f) < factor - 1e-3} == {"at rest"}
    assert {word for f, word in tried if float(f) > factor + 1e-3} == {"keeps moving"}
    told = json.loads(answer.read_text())["scene"]
    assert told["factor_of_safety"] == pytest.approx(factor, rel=1e-6)
    assert list(told["moving"]) == ["slab"]
    assert main(["safety", str(scene), "--reduce", "bedding"]) == BAD_INPUT
    assert "no joint 'bedding' to reduce" in capsys.readouterr().err
    assert main(["safety", str(scene), "--set", "joints.default.friction_angle_deg=0.0"]) == BAD_INPUT


def test_safety_reports_what_an_engineer_signs(tmp_path, capsys):
    scene, answer, picture = tmp_path / "slope.toml", tmp_path / "new" / "safety.json", tmp_path / "new" / "way.png"
    scene.write_text(SLOPE)
    asked = ["safety", str(scene), "--quiet", "--along", "default", "--divide", "cohesion=1.25", "friction=1.25"]
    assert main([*asked, "--json", str(answer), "--picture", str(picture)]) == DONE
    out, _ = capsys.readouterr()
    factor = math.tan(math.radians(35)) / 0.5 / 1.25
    assert f"factor of safety {factor:.4f} (equilibrium at 1.1" in out and "none at 1.1" in out
    assert "cohesion by 1.25, tan φ by 1.25, tensile strength by 1; the design strength suffices" in out
    assert "mechanism: sliding" in out and "towards -153°: slides" in out and "100%" in out
    assert "blocks have moved by" in out and str(picture) in out
    told = json.loads(answer.read_text())["scene"]
    assert told["factor_of_safety"] == pytest.approx(factor, rel=1e-6) and told["mechanism"] == "sliding"
    assert told["partial_factors"] == {"cohesion": 1.25, "friction": 1.25, "tension": 1.0}
    assert told["joints"][0]["mobilised"] == pytest.approx(1.0, abs=3e-3) and told["along"] == ["default"]
    assert told["moving"]["slab"]["kind"] == "slides" and told["search"]["largest_displacement_m"] > 0
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 5000


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (["--divide", "frction=1.2"], "--divide: no strength 'frction' to divide; there are cohesion"),
        (["--divide", "cohesion"], "--divide: a partial factor is given as cohesion=1.25"),
        (["--along", "default", "bed"], "no joint 'bed' to reduce"),
        (["--along", "bed"], "'default'"),
    ],
)
def test_safety_refuses_what_it_does_not_know_by_name(asked, why, tmp_path, capsys):
    scene = tmp_path / "slope.toml"
    scene.write_text(SLOPE)
    assert main(["safety", str(scene), "--quiet", *asked]) == BAD_INPUT
    assert why in capsys.readouterr().err


def with_crack(points: str) -> str:
    """The slope with a crack through its rock."""
    cracked = SLOPE.replace("[materials.rock]", f'cracks = [{{ name = "flaw", points = {points} }}]\n[materials.rock]')
    return cracked.replace("density_kg_m3 = 2600", "density_kg_m3 = 2600\nk_ic_pa_sqrt_m = 2e6")


def test_safety_gives_no_factor_of_blocks_that_rock_bridges_may_hold(tmp_path, capsys):
    scene, answer = tmp_path / "slope.toml", tmp_path / "safety.json"
    scene.write_text(with_crack("[[5.0, 2.8], [5.0, 3.2]]"))
    asked = ["safety", str(scene), "--quiet", "--out", str(answer)]
    assert main(asked) == BAD_INPUT
    out, err = capsys.readouterr()
    assert "factor" not in out and "no factor of safety: flaw" in err and "--without-cracks" in err
    assert not answer.exists()
    assert main([*asked, "--without-cracks"]) == DONE
    out, _ = capsys.readouterr()
    factor = math.tan(math.radians(35)) / 0.5
    assert f"factor of the blocks without their cracks {factor:.4f}" in out and "factor of safety 1" not in out
    told = json.loads(answer.read_text())["scene"]
    assert told["factor_of_safety"] is None and told["factor_without_cracks"] == pytest.approx(factor, rel=1e-6)
    assert told["cracks_left_out"] == ["flaw"] and told["caution"] in out


def test_a_crack_in_fixed_rock_takes_nothing_from_a_factor_of_safety(tmp_path, capsys):
    scene = tmp_path / "slope.toml"
    scene.write_text(with_crack("[[8.0, 1.0], [8.5, 2.0]]"))
    assert main(["safety", str(scene), "--quiet"]) == DONE
    assert f"factor of safety {math.tan(math.radians(35)) / 0.5:.4f}" in capsys.readouterr().out


def test_a_fault_of_ours_is_no_bad_input_of_safety(tmp_path, capsys, monkeypatch):
    from geomech import dda

    def fails(*_, **__):
        raise ValueError("operands could not be broadcast together")

    monkeypatch.setattr(dda, "factor_of_safety", fails)
    scene = tmp_path / "slope.toml"
    scene.write_text(SLOPE)
    assert main(["safety", str(scene)]) == FAILED
    assert "--debug" in capsys.readouterr().err


@pytest.mark.parametrize(
    "asked", [["dda", "--seeds", "0-3"], ["slopes", "--seeds", "3-0"], ["slopes", "--seeds", "some"]]
)
def test_seeds_are_two_numbers_and_belong_to_slopes(asked, capsys):
    assert main(["bench", *asked]) == BAD_INPUT
    assert "--seeds" in capsys.readouterr().err


@pytest.mark.parametrize(
    "line",
    [
        "bench ddm --quick --out FOLDER", "bench ddm --quick --out FILE/figures.json", "safety SCENE --out FOLDER",
        "report RUN --out FOLDER", "build SCENE --out FILE", "build SCENE --picture FOLDER", "render RUN --out FILE",
        "run SCENE --out FILE",
    ],
)  # fmt: skip
def test_files_that_cannot_be_written_are_refused_before_anything_is_done(line, tmp_path, monkeypatch, capsys):
    """A benchmark was measured for half a minute and then could not be written."""
    places = {name: tmp_path / name.lower() for name in ("FOLDER", "FILE", "SCENE", "RUN")}
    places["FOLDER"].mkdir()
    places["FILE"].write_text("")
    for what in ("bench.topic", "bench.figures.yardstick", "scene.load_scene", "output.Run"):
        monkeypatch.setattr(f"geomech.{what}", lambda *given, **options: pytest.fail("went on"))
    words = line.split()
    for name, place in places.items():
        words = [word.replace(name, str(place)) for word in words]
    assert main(words) == BAD_INPUT
    told = capsys.readouterr().err
    assert told.startswith("geomech: --out: " if "--out" in line else "geomech: --picture: ")
    assert "is a folder" in told or "is a file" in told


def test_the_folder_of_a_file_need_not_be_there(tmp_path):
    check_writable("--out", tmp_path / "new" / "deep" / "figures.json")
    check_folder("--out", tmp_path / "new" / "deep")
    assert not (tmp_path / "new").exists()
