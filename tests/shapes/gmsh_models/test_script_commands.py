"""Models that would do more than draw are refused by file, line and name, before Gmsh sees them; none of them does it.

That nothing happens is looked for on the disk; which commands Gmsh runs is told by Gmsh itself, with the refusal off.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from geomech import cli
from geomech.scene import SceneError, load_scene
from geomech.shapes import GmshModelError, read_gmsh_model
from geomech.shapes.gmsh_models import isolated_reader
from geomech.shapes.gmsh_models.script_commands import TRUST, is_light, refuse_commands

ROOT = Path(__file__).parents[3]
#: A square of rock.
DRAWN = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Physical Surface("rock") = {1};
"""
SCENE = """
[geometry]
model = "model.geo"
[materials.rock]
youngs_modulus_pa = 1e9
poissons_ratio = 0.2
density_kg_m3 = 2000
[run]
end_time_s = 1
"""
#: Commands, each of which makes "made" where Gmsh is let; and the words by which they are refused.
ATTACKS = {
    'SystemCall "touch made";': "SystemCall",
    'System "touch made";': "System",
    'NonBlockingSystemCall "touch made"; Sleep 1;': "NonBlockingSystemCall",
    'a = "touch made"; SystemCall Str(a);': "SystemCall",
    'SystemCall StrCat("touch ", "made");': "SystemCall",
    'S2N["SystemCall"] "touch made";': "S2N",
    'StringToName[StrCat("System", "Call")] "touch made";': "StringToName",
    'Printf("x") > "made";': "Printf > …",
    'Printf("%g", 1) >> "made";': "Printf > …",
    'Printf(StrCat("(", "x")) > "made";': "Printf > …",
    'Save "made.msh";': "Save",
    'CreateDir "made";': "CreateDir",
    # What follows a text that Gmsh's scanner cuts is code.
    f"a = \"{'x' * 1100} ; SystemCall 'touch made' ; //\";": "a text without an end",
    # The second turn of a loop begins behind its first line, in the middle of the comment.
    'For k In {1:2} /*\n SystemCall "touch made"; //*/\nEndFor': "SystemCall",
    'Macro made /*\n SystemCall "touch made";\n Return //*/\nReturn\nCall made;': "SystemCall",
    "a = '\nb = 1; // '; SystemCall \"touch made\";": "SystemCall",
}
OTHERS = {
    'General.LogFileName = "made";': "General.LogFileName",  # which Gmsh 4.12 has not got
    'Print "made.png";': "Print",
    'OnelabRun("solver", "touch made");': "OnelabRun",
    'Field[1] = ExternalProcess; Field[1].CommandLine = "touch made";': "ExternalProcess",
    "Plugin(Triangulate).Run;": "Plugin",
    'Solver.Executable0 = "touch";': "Solver",
    "Exit;": "Exit",
    "Sleep 100;": "Sleep",
    'a = GetEnv("HOME");': "GetEnv",
    'Include "/etc/hostname";': 'Include "/etc/hostname"',
    'Merge "../other.geo";': 'Merge "../other.geo"',
    'a() = ShapeFromFile("../../x.brep");': "ShapeFromFile",
    'a = "x.geo"; Include a;': "Include",
    "a = 1;\0SystemCall 'touch made';": "a zero byte",
    # C's printf takes these texts: they read and write memory.
    'Printf("%s%n%s%n");': 'Printf("%s%n%s%n"',
    'a = Str(Sprintf("%n", 1));': 'Sprintf("%n"',
    'a = Str(Sprintf("%1000000000g", 1));': 'Sprintf("%1000000000g"',
    'Error("%s");': 'Error("%s"',
    'Warning("%d");': 'Warning("%d"',
    'b = "%n"; Printf(b);': "Printf",
    'Printf(StrCat("%", "n"));': "Printf",
    'Field[1] = Structured; Field[1].FileName = "/etc/passwd";': ".FileName",
}


def written(folder: Path, text: str, name: str = "model.geo") -> Path:
    path = folder / name
    path.write_text(DRAWN + text + "\n")
    return path


@pytest.mark.parametrize("attack", [*ATTACKS, *OTHERS])
def test_what_does_more_than_draw_is_refused_by_name_and_line(tmp_path, attack, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, attack)
    with pytest.raises(GmshModelError) as caught:
        read_gmsh_model(path)
    line = 5 if "\n " in attack else 4
    wanted = (ATTACKS | OTHERS)[attack]
    assert caught.value.message.startswith(f"{path}:{line + attack.startswith('a = ' + chr(39))}: {wanted}")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("attack", ATTACKS)
def test_gmsh_would_have_done_it(tmp_path, attack):
    """The list above is of what Gmsh does, not of what somebody believes that it does."""
    path = written(tmp_path, attack)
    code = f"from geomech.shapes import read_gmsh_model; read_gmsh_model({str(path)!r})"
    subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {TRUST: "1"}, capture_output=True, check=False,
        timeout=60,
    )  # fmt: skip
    assert list(tmp_path.glob("made*"))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("model.msh", 'SystemCall "touch made";\n'),
        ("model.txt", DRAWN),
        ("model.py", "print()"),
        ("x;touch made;.gz", "x"),
        ("model.BREP", 'SystemCall "touch made";\n'),
    ],
)
def test_files_that_gmsh_would_take_for_scripts_are_refused(tmp_path, name, text, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(GmshModelError, match=r"not a Gmsh mesh|take a file called"):
        read_gmsh_model(path)
    assert list(tmp_path.iterdir()) == [path]


def test_options_beside_a_model_are_read_as_gmsh_reads_them(tmp_path):
    path = written(tmp_path, "")
    options = tmp_path / "model.geo.opt"
    options.write_text("Mesh.ElementOrder = 1;\n")
    assert len(read_gmsh_model(path).zones) == 1
    options.write_text('Mesh.ElementOrder = 1;\nSystemCall "touch made";\n')
    with pytest.raises(GmshModelError, match=r"model\.geo\.opt:2: SystemCall runs a shell command"):
        read_gmsh_model(path)


def test_files_below_the_folder_may_be_read_and_are_looked_at(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "sizes.geo").write_text("side = 2;\n")
    (tmp_path / "parts" / "more.geo").write_text('Merge "../scene/sizes.geo";\n')
    path = tmp_path / "model.geo"
    path.write_text('Include "parts/more.geo";\n' + DRAWN.replace("1, 1}", "side, side}"))
    assert read_gmsh_model(path).zones[0].loops[0].max() == pytest.approx(2.0)
    assert [each.name for each in refuse_commands(path)] == ["model.geo", "more.geo", "sizes.geo"]
    # Of the folder of the scene, which may be above the model's.
    inner = tmp_path / "scene" / "model.geo"
    inner.write_text('Include "../parts/more.geo";\n' + DRAWN)
    with pytest.raises(GmshModelError, match="reads a file outside"):
        read_gmsh_model(inner)
    assert len(read_gmsh_model(inner, folder=tmp_path).zones) == 1
    (tmp_path / "link.geo").symlink_to("/etc/hostname")
    path.write_text('Include "link.geo";\n' + DRAWN)
    with pytest.raises(GmshModelError, match=r'model\.geo:1: Include "link\.geo" reads a file outside'):
        read_gmsh_model(path)
    (tmp_path / "parts" / "more.geo").write_text('a = 1;\nSave "x.msh";\n')
    path.write_text('Include "parts/more.geo";\n' + DRAWN)
    with pytest.raises(GmshModelError, match=r"parts/more\.geo:2: Save writes a file"):
        read_gmsh_model(path)


def test_words_in_names_comments_and_texts_are_no_commands(tmp_path):
    harmless = """// Save "x"; SystemCall "x"
/* Include the "file";
   SystemCall "x"; */
Printf("%g > %g", 1, 2); Printf("Save it");
Print.Background = 0; Mesh.SaveAll = 1; General.Terminal = 0;
SaveAll = 1; mySystemCall = 2; If (1 > 2) Printf("never"); EndIf
"""
    assert len(read_gmsh_model(written(tmp_path, harmless)).zones) == 1


@pytest.mark.parametrize("text", ["For k In {1:2}\n x = k;\nEndFor", "x[] = {0:9};", "Mesh 2;", 'Include "x.geo";'])
def test_what_may_take_any_time_is_read_in_another_process(tmp_path, text):
    assert not is_light(written(tmp_path, text))
    assert is_light(written(tmp_path, 'Mesh.Order = 1; x = (1 > 2) ? 1 : 2; // For\ny = "For {1:2}";'))


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("For k In {1:1e12}\n x = k;\nEndFor", "within 1 s of processor time"),
        ("Macro A\n Call A;\nReturn\nCall A;", "within 1 s of processor time"),
        ("x[] = {0:1e10};", r"within 1 s of processor time|GiB of memory|its reader crashed"),
    ],
)
def test_scripts_without_an_end_are_refused(tmp_path, text, why, monkeypatch):
    monkeypatch.setattr(isolated_reader, "SECONDS", 1)
    with pytest.raises(GmshModelError, match=why):
        read_gmsh_model(written(tmp_path, text))


def test_surfaces_beyond_all_numbers_are_refused(tmp_path):
    path = tmp_path / "model.geo"
    path.write_text(
        "Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {0, 1, 0}; Point(9) = {1e308, 1e309, 0};\n"
        "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 1}; Curve Loop(1) = {1, 2, 3}; Plane Surface(1) = {1};\n"
        'Physical Surface("rock") = {1};\n'
    )
    with pytest.raises(GmshModelError, match="that are not finite"):
        read_gmsh_model(path)


def test_all_models_of_the_project_are_let_through():
    for path in [*ROOT.glob("geometry/*.geo"), *ROOT.glob("pipelines/*/*.geo")]:
        assert refuse_commands(path) == [path.resolve()]


def test_a_scene_is_refused_with_its_place_and_trusted_on_demand(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(TRUST, "")
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    written(tmp_path, 'SystemCall "touch made";')
    with pytest.raises(SceneError) as caught:
        load_scene(scene)
    (fault,) = caught.value.errors
    assert fault.place == f"{scene}:3: geometry.model" and "model.geo:4: SystemCall" in fault.message
    assert "--trust-models" in fault.way_out
    assert cli.main(["check", str(scene)]) == cli.BAD_INPUT and not Path("made").exists()
    assert cli.main(["check", str(scene), "--trust-models"]) == cli.DONE and Path("made").exists()
