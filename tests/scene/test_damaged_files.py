"""Damaged and hostile files end as refusals with file and place: none ends the process, hangs, or raises what a scene
does not raise."""

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest
from scene_texts import GOOD

from geomech.scene import SceneError, load_scene
from geomech.shapes import FieldFileError, GmshModelError, read_field_file, read_gmsh_model
from geomech.shapes.gmsh_models import isolated_reader

ROOT = Path(__file__).parents[2]
HEAD = """
[materials.rock]
youngs_modulus_pa = 1e9
poissons_ratio = 0.2
density_kg_m3 = 2000
k_ic_pa_sqrt_m = 1e6
[run]
end_time_s = 1
"""
#: A rectangle with a round hole beside another one, in OpenCASCADE; and the same as shapes and as a mesh.
DRAWN = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 4, 3};
Disk(2) = {2, 1.5, 0, 0.5};
Rectangle(3) = {4, 0, 0, 2, 2.5};
BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }
BooleanFragments{ Surface{:}; Delete; }{}
Physical Surface("rock") = Surface{:};
Mesh.MeshSizeMax = 1;
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The drawing as .brep, .step, .msh and a traced slope as .dxf: suffix → bytes."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "model.geo").write_text(DRAWN)
    code = "import gmsh; gmsh.initialize(readConfigFiles=False); gmsh.merge('model.geo'); gmsh.write('model.brep'); "
    code += "gmsh.write('model.step'); gmsh.model.mesh.generate(2); gmsh.write('model.msh')"
    subprocess.run([sys.executable, "-c", code], cwd=folder, check=True, capture_output=True)
    found = {suffix: (folder / f"model{suffix}").read_bytes() for suffix in (".brep", ".step", ".msh")}
    return found | {".dxf": (ROOT / "geometry" / "traced_slope.dxf").read_bytes()}


def spoilt(data: bytes, rng: random.Random) -> bytes:
    """Bytes changed, lines left out or exchanged, or the end missing."""
    kind, lines = rng.randrange(4), data.split(b"\n")
    first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
    if kind == 0:
        at = rng.randrange(len(data))
        return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
    if kind == 1:
        del lines[first : first + 2]
    elif kind == 2:
        lines[first], lines[second] = lines[second], lines[first]
    return data[: rng.randrange(len(data))] if kind == 3 else b"\n".join(lines)


def loaded(folder: Path, suffix: str, data: bytes) -> None:
    """Load a scene of the file, and make its problem."""
    (folder / f"model{suffix}").write_bytes(data)
    if suffix == ".dxf":
        what = '[[geometry.traces]]\nfile = "model.dxf"\nlayers = { "*" = "" }\n'
    else:
        what = f'[geometry]\nmodel = "model{suffix}"\n'
    (folder / "scene.toml").write_text(what + HEAD)
    load_scene(folder / "scene.toml").problem()


@pytest.mark.parametrize("suffix", [".brep", ".step", ".msh", ".dxf"])
@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 60), marks=pytest.mark.slow)])
def test_damaged_files_are_refused_or_read(files, tmp_path, suffix, seeds, monkeypatch):
    monkeypatch.setattr(isolated_reader, "SECONDS", 3)
    loaded(tmp_path, suffix, files[suffix])
    for seed in seeds:
        try:
            loaded(tmp_path, suffix, spoilt(files[suffix], random.Random(f"{suffix} {seed}")))
        except SceneError as refused:
            assert all(fault.place.startswith(str(tmp_path)) and fault.message for fault in refused.errors)


def test_a_file_that_ends_its_reader_is_refused(tmp_path, monkeypatch):
    """As a missing line makes OpenCASCADE read beyond what there is."""
    path = tmp_path / "model.brep"
    path.write_bytes(b"")
    monkeypatch.setattr(isolated_reader, "_CHILD", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    with pytest.raises(GmshModelError, match=r"model\.brep cannot be read: its reader crashed \(SIGSEGV\)"):
        read_gmsh_model(path)


def test_a_file_that_takes_too_long_or_too_much_is_refused(files, tmp_path, monkeypatch):
    path = tmp_path / "model.geo"
    (tmp_path / "part.brep").write_bytes(files[".brep"])
    path.write_text('Merge "part.brep";\nFor k In {1:1e9}\na = k;\nEndFor\n')
    monkeypatch.setattr(isolated_reader, "SECONDS", 1)
    with pytest.raises(GmshModelError, match=r"model\.geo cannot be read within 1 s of processor time"):
        read_gmsh_model(path)
    limited = "import resource; resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30)); bytearray(1 << 31)"
    monkeypatch.setattr(isolated_reader, "_CHILD", limited)
    with pytest.raises(GmshModelError, match=r"part\.brep cannot be read within 4 GiB of memory"):
        read_gmsh_model(tmp_path / "part.brep")


def test_what_the_reader_finds_is_what_is_found_here(files, tmp_path, monkeypatch):
    from geomech.shapes.gmsh_models.model_files import read_here

    for suffix in (".brep", ".step", ".msh"):
        path = tmp_path / f"model{suffix}"
        path.write_bytes(files[suffix])
        apart_, here = read_gmsh_model(path), read_here(path, {}, None, None)
        assert apart_.parameters == here.parameters and apart_.warnings == here.warnings
        assert apart_.places == here.places and len(apart_.zones) == len(here.zones) == 2
        for a, b in zip(apart_.zones, here.zones):
            assert a.name == b.name and a.edge_names == b.edge_names
            assert all(x.tobytes() == y.tobytes() for x, y in zip(a.loops, b.loops, strict=True))


def test_a_name_that_is_no_utf8_is_refused_with_its_line(tmp_path):
    path = tmp_path / "model.geo"
    path.write_bytes(("// Höhe\n" + DRAWN).replace('"rock"', '"Höhle"').encode("latin-1"))
    with pytest.raises(GmshModelError, match=r"model\.geo:8: a name with the byte 0xf6 is not UTF-8 text"):
        read_gmsh_model(path)
    path.write_bytes(("// Höhe\n" + DRAWN).encode("latin-1"))
    assert len(read_gmsh_model(path).zones) == 2


@pytest.mark.parametrize(
    "text",
    ["a = " + "[" * 2000 + "]" * 2000, ".".join("a" * 2000) + " = 1", "[" + ".".join("a" * 2000) + "]",
     "a = " + "[" * 100 + "]" * 100],
)  # fmt: skip
def test_a_scene_nested_too_deep_is_refused_with_its_line(tmp_path, text):
    (tmp_path / "scene.toml").write_text("# a scene\n" + text + "\n")
    with pytest.raises(SceneError, match=r"scene\.toml:2\n    tables and arrays are nested deeper than"):
        load_scene(tmp_path / "scene.toml")


@pytest.mark.parametrize("key", ["increment_m", "min_increment_m"])
@pytest.mark.parametrize("value", ["5e-324", "1e-12"])
def test_an_advance_below_round_off_is_refused(tmp_path, key, value):
    (tmp_path / "scene.toml").write_text(GOOD.replace("[run]", f"[growth]\n{key} = {value}\n[run]"))
    told = value.replace("5e", "4.94066e")
    with pytest.raises(SceneError, match=f"growth.{key}\n    an advance of {told} m is lost"):
        load_scene(tmp_path / "scene.toml")


@pytest.mark.parametrize(
    "text",
    [
        '{"type": "FeatureCollection", "features": 3}',
        '{"type": "FeatureCollection", "features": [3]}',
        '{"type": "FeatureCollection", "features": [{"properties": [1]}]}',
        '{"type": "FeatureCollection", "features": [{"geometry": [1]}]}',
        '{"type": "FeatureCollection", "crs": "x", "features": [{"geometry": {"type": [1], "coordinates": 1}}]}',
        '{"type": "FeatureCollection", "features": [{"geometry": {"type": "Polygon", "coordinates": {"a": 1}}}]}',
        '{"type": "FeatureCollection", "features": ' + "[" * 100_000 + "]" * 100_000 + "}",
    ],
)
def test_geojson_of_another_shape_is_refused(tmp_path, text):
    path = tmp_path / "traces.geojson"
    path.write_text(text)
    with pytest.raises(FieldFileError, match=r"traces.geojson"):
        read_field_file(path)


@pytest.mark.parametrize(
    "name", ["../../escaped", "/tmp/absolute", "..", "", " ", ".hidden", "a/b", "a\\\\b", "a\\u0000b", "c:d", "x" * 201]
)
def test_a_variant_names_a_folder_below_the_output_folder(tmp_path, name):
    changes = f'\n[variants."{name}"]\n"run.end_time_s" = 2\n'
    (tmp_path / "scene.toml").write_text(GOOD + changes)
    with pytest.raises(SceneError, match="name of a folder") as caught:
        load_scene(tmp_path / "scene.toml")
    line = (GOOD + changes).splitlines().index(changes.splitlines()[1]) + 1
    assert caught.value.errors[0].place.startswith(f"{tmp_path / 'scene.toml'}:{line}: variants")


def test_other_names_of_variants_are_as_free_as_before(tmp_path):
    names = ["phi_30", "a b", "1.5 MPa", "große Höhle", "-x"]
    changes = "".join(f'[variants."{name}"]\n"run.end_time_s" = 2\n' for name in names)
    (tmp_path / "scene.toml").write_text(GOOD + "\n" + changes)
    assert load_scene(tmp_path / "scene.toml").variants == tuple(names)


def test_a_plain_script_is_read_in_this_process(tmp_path, monkeypatch):
    """Scenes with a .geo do not pay for another process."""
    (tmp_path / "model.geo").write_text(DRAWN)
    monkeypatch.setattr(isolated_reader, "model_apart", None)
    assert len(read_gmsh_model(tmp_path / "model.geo").zones) == 2
    assert os.environ.get("GEOMECH_TRUST_MODELS", "") in ("", "0")


def test_an_integer_that_python_does_not_read_is_refused_with_its_line(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("[run]\nend_time_s = " + "9" * 5000 + "\n")
    with pytest.raises(SceneError, match=r"scene\.toml:2\n    not a number"):
        load_scene(path)


@pytest.mark.parametrize(
    "entry", ['model = "NAME.geo"', '[[geometry.traces]]\nfile = "NAME.csv"', '[[geometry.traces]]\nfile = "NAME.dxf"']
)
def test_a_file_name_that_is_too_long_is_no_file(tmp_path, entry):
    (tmp_path / "scene.toml").write_text("[geometry]\n" + entry.replace("NAME", "a" * 300) + "\n")
    with pytest.raises(SceneError, match=r"there is no file"):
        load_scene(tmp_path / "scene.toml")
