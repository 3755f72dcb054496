"""The ParaView series, read back by VTK (PyVista) and by meshio and held against the made-up run's closed forms.

Tolerances: files hold doubles, so arrays that are copied agree exactly; quantities recomputed here agree to 1e-12
relative to their size; interior fields are single precision, 1e-6.
"""

from __future__ import annotations

import math
import threading
from copy import copy
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
import synthetic_run as made

from geomech.conventions import VTK_STRESS
from geomech.model import TIP, Blocks, CrackFaces, Cracks, Motion, State
from geomech.output import Series
from geomech.output.fields import SERIES
from geomech.output.reading import read_grid
from geomech.output.vtk.interior_fields import InteriorMeshes, Stopped
from geomech.output.vtk.series import PASS_OFFSET, SeriesTime
from geomech.output.vtk.vtu import SMALL, Collection, Grid, GridFiles, read_collection

pv = pytest.importorskip("pyvista")


def last_file(folder: Path, name: str) -> Path:
    return read_collection(folder / f"{name}.pvd")[-1][1]


def components(array_owner, name: str) -> tuple[str, ...]:
    array = array_owner.VTKObject.GetAbstractArray(name)
    return tuple(array.GetComponentName(k) for k in range(array.GetNumberOfComponents()))


@pytest.mark.parametrize("name", SERIES)
def test_vtk_reads_every_declared_field_with_its_component_names(run_folder, name):
    reader = pv.get_reader(str(run_folder / f"{name}.pvd"))
    reader.set_active_time_point(len(reader.time_values) - 1)
    mesh = reader.read()[0]
    assert mesh.n_points > 0
    for field in SERIES[name]:
        data = mesh.point_data if field.place == "point" else mesh.cell_data
        assert data[field.name].dtype == field.dtype
        if field.components:
            assert components(data, field.name) == field.components
    assert mesh.field_data["CYCLE"][0] == 6
    assert mesh.field_data["TIME"][0] == 3.0
    assert mesh.field_data["LOAD"][0] == 3 * made.RATE


@pytest.mark.parametrize("name", SERIES)
def test_meshio_reads_the_same_numbers_as_vtk(run_folder, name):
    file = last_file(run_folder, name)
    ours, theirs = meshio.read(file), pv.read(file)
    assert np.array_equal(ours.points, theirs.points)
    for field in SERIES[name]:
        a = ours.point_data[field.name] if field.place == "point" else ours.cell_data[field.name][0]
        b = (theirs.point_data if field.place == "point" else theirs.cell_data)[field.name]
        assert np.array_equal(a.reshape(b.shape), b, equal_nan=True), field.name


def test_stress_columns_stand_in_vtks_order(run_folder):
    mesh = pv.read(last_file(run_folder, "blocks"))
    load = 3 * made.RATE
    rock = mesh["block_id"] == 1
    # Plane strain: σzz = ν(σxx + σyy). Rounding of single precision is 6e-8.
    expected = {"XX": 0.0, "YY": -load, "ZZ": -0.21 * load, "XY": 0.0, "YZ": 0.0, "XZ": 0.0}
    for k, name in enumerate(VTK_STRESS):
        assert np.allclose(mesh["stress"][rock][:, k], expected[name], rtol=1e-7, atol=0)
    assert np.allclose(mesh["principal_stress"][rock], [0.0, -0.21 * load, -load], rtol=1e-7, atol=1e-9)


def test_block_triangles_cover_notch_and_hole_exactly(run_folder):
    mesh = pv.read(last_file(run_folder, "blocks"))
    area = mesh.compute_cell_sizes(length=False, volume=False)["Area"]
    blocks = made.blocks()
    # Areas by the shoelace formula, an independent sum; 1e-12 is round-off.
    assert np.allclose([area[mesh["block_id"] == b].sum() for b in range(3)], blocks.areas(), rtol=1e-12)
    # Each block keeps its own vertices, or joints could not open.
    assert mesh.n_points == blocks.n_vertices


def test_displacement_and_velocity_are_those_of_the_vertices(tmp_path):
    cycle = made.cycle(0, 3, 0, 0, turn=0.2)
    spinning = replace(cycle.state, velocity=np.array([[0.0] * 6, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], [0.0] * 6]))
    written_alone(tmp_path, replace(cycle, state=spinning))
    mesh = pv.read(last_file(tmp_path, "blocks"))
    assert np.array_equal(mesh["displacement"][:, :2], cycle.state.vertices - cycle.blocks.vertices)
    # A block that only spins at 2 rad/s: speed is 2 r about the centroid, which Shapely finds.
    import shapely

    loops = cycle.blocks.loops(1, cycle.state.vertices)
    centroid = shapely.get_coordinates(shapely.Polygon(loops[0], loops[1:]).centroid)[0]
    mine = cycle.blocks.vertex_block == 1
    arm = cycle.state.vertices[mine] - centroid
    expected = 2.0 * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    assert np.allclose(mesh["velocity"][mine, :2], expected, rtol=1e-7, atol=1e-14)  # single precision


def test_cracks_ride_on_their_block(tmp_path):
    """Crack points and tips move as the block does: stretched, turned by 0.2 rad and lifted."""
    written_alone(tmp_path, made.cycle(0, 300, 0, 2, turn=0.2))
    for name in ("cracks", "tips"):
        mesh = pv.read(last_file(tmp_path, name))
        expected = made.placement(mesh.points[:, :2], 300 * made.RATE, 0.2)
        assert np.allclose(mesh.points[:, :2] + mesh["displacement"][:, :2], expected, rtol=0, atol=1e-15)


def test_current_configuration_puts_everything_where_it_is(tmp_path):
    cycle = made.cycle(0, 300, 0, 2, turn=0.2)
    written_alone(tmp_path / "r", cycle, configuration="reference")
    written_alone(tmp_path / "c", cycle, configuration="current")
    for name in ("blocks", "cracks", "tips", "contacts", "interior"):
        reference, current = (pv.read(last_file(tmp_path / f, name)) for f in "rc")
        assert np.allclose(reference.points + reference["displacement"], current.points, rtol=0, atol=1e-15), name
        assert (reference.field_data["REFERENCE"][0], current.field_data["REFERENCE"][0]) == (1, 0)
    turned = pv.read(last_file(tmp_path / "c", "tips"))["growth_direction"][:, :2]
    straight = pv.read(last_file(tmp_path / "r", "tips"))["growth_direction"][:, :2]
    c, s = math.cos(0.2), math.sin(0.2)
    # The strain of 1e-3 turns a direction by no more than itself.
    assert np.allclose(turned, straight @ np.array([[c, s], [-s, c]]), atol=5e-3)


def test_cracks_are_lines_with_points_of_their_own(run_folder):
    mesh = pv.read(last_file(run_folder, "cracks"))
    cycle = made.cycles()[-1]
    n_elements, n = cycle.faces.opening.shape
    assert mesh.n_points == n_elements * n
    assert mesh.n_cells == n_elements * (n - 1)
    assert np.array_equal(mesh["opening"], cycle.faces.opening.ravel())
    assert np.array_equal(mesh["shear_traction"], cycle.faces.traction[..., 1].ravel())
    assert np.array_equal(np.unique(mesh["birth_cycle"]), [0, 1, 2, 3])
    length = mesh.compute_cell_sizes(area=False, volume=False)["Length"]
    assert math.isclose(length.sum(), cycle.cracks.lengths.sum(), rel_tol=1e-12)


def test_tip_angle_is_in_degrees_and_direction_agrees_with_it(run_folder):
    mesh = pv.read(last_file(run_folder, "tips"))
    tips = made.cycles()[-1].tips
    assert np.allclose(mesh["growth_angle"], math.degrees(1.0), rtol=1e-15)
    d = tips["direction"]
    turned = np.arctan2(mesh["growth_direction"][:, 1], mesh["growth_direction"][:, 0]) - np.arctan2(d[:, 1], d[:, 0])
    assert np.allclose(np.angle(np.exp(1j * turned)), 1.0, rtol=1e-12)


def test_contact_force_points_as_the_conventions_say(run_folder):
    """Edge of the lower block, outward normal up, so its direction (rock on the left) runs to −x."""
    mesh = pv.read(last_file(run_folder, "contacts"))
    load = 3 * made.RATE
    # Rounding of single precision is 6e-8.
    assert np.allclose(mesh["force"], [[-0.01 * load, 0.03 * load, 0], [0.01 * load, 0.03 * load, 0]], rtol=1e-7)


def test_interior_is_the_bodys_field_on_the_blocks_motion(tmp_path):
    """The body knows its displacement up to a rigid motion; the file's must be the block's, whatever the body's was."""
    written_alone(tmp_path, made.cycle(0, 300, 0, 2, turn=0.2))
    mesh = pv.read(last_file(tmp_path, "interior"))
    load, c, s = 300 * made.RATE, math.cos(0.2), math.sin(0.2)
    expected = made.placement(mesh.points[:, :2], load, 0.2)
    # The rigid part is fitted to linear order in the body's own spin (3e-4): what is left is spin² · size / 2 = 3e-9 m,
    # and the nodes on crack faces are looked at 1e-5 of their triangle aside.
    assert np.allclose(mesh.points[:, :2] + mesh["displacement"][:, :2], expected, rtol=0, atol=1e-8)
    # Uniaxial stress turned with the block: R σ Rᵀ of σyy = −load.
    turned = np.array([-s * s, -c * c, s * c]) * load
    assert np.allclose(mesh["stress"][:, [0, 1, 3]], turned, rtol=1e-6, atol=load * 1e-6)
    assert np.allclose(mesh["von_mises"], load * math.sqrt(1 - 0.21 + 0.21**2), rtol=1e-6)


def test_faces_of_a_crack_are_looked_at_from_their_own_sides(tmp_path):
    """A body whose displacement jumps across the crack must show both values on it."""

    class Torn(made.UniformBody):
        def displacement(self, points):
            out = np.zeros((len(points), 2))
            out[:, 0] = np.where(points[:, 1] > points[:, 0], 1e-6, -1e-6)  # across the line of the flaw at 45°
            return out

    cycle = made.cycle(0, 0, 0, 0)
    written_alone(tmp_path, replace(cycle, bodies={1: Torn(0.0)}))
    mesh = pv.read(last_file(tmp_path, "interior"))
    x, y = mesh.points[:, :2].T
    on = (np.abs(x - y) < 1e-12) & (np.hypot(x, y) < 0.9 * made.HALF_LENGTH)
    above = on & (mesh["displacement"][:, 0] > 0)
    assert on.sum() > 4
    assert above.sum() * 2 == on.sum()
    jump = mesh["displacement"][above, 0].mean() - mesh["displacement"][on & ~above, 0].mean()
    assert math.isclose(jump, 2e-6, rel_tol=1e-3)  # less the rigid part that was taken out, the same on both sides


def test_interior_mesh_is_kept_while_the_geometry_stands(run_folder):
    files = [file for _, file in read_collection(run_folder / "interior.pvd")]
    meshes = [pv.read(file) for file in files]
    cycles = [int(mesh.field_data["CYCLE"][0]) for mesh in meshes]
    assert cycles == [
        0,
        1,
        4,
        6,
    ]  # the start, the first load, the initiation, then every 2 cycles while the crack grows
    same = [mesh for mesh, cycle in zip(meshes, cycles) if cycle < 4]
    assert all(np.array_equal(mesh.points, same[0].points) for mesh in same)
    assert meshes[-1].n_points > same[0].n_points


def test_times_increase_strictly_and_read_back_exactly(run_folder):
    for name in SERIES:
        times = [time for time, _ in read_collection(run_folder / f"{name}.pvd")]
        assert (np.diff(times) > 0).all()
    times = [time for time, _ in read_collection(run_folder / "blocks.pvd")]
    # Load steps at whole seconds, growth passes PASS_OFFSET of a step later each.
    assert times == [0.0, 1.0, 2.0, 3.0, *(3.0 + p * PASS_OFFSET for p in (1, 2, 3))]
    assert pv.get_reader(str(run_folder / "blocks.pvd")).time_values == times


def test_times_increase_even_where_the_clock_does_not():
    clock = SeriesTime()
    cycle = made.cycle(0, 5, 0, 0)
    times = [clock.of(cycle) for _ in range(5)]
    assert (np.diff(times) > 0).all()
    assert times[-1] - 5.0 < 1e-5


def test_collection_refuses_a_time_that_goes_back(tmp_path):
    collection = Collection(tmp_path / "a.pvd")
    collection.add(1.0, "vtk/a.vtu")
    with pytest.raises(ValueError, match="does not follow"):
        collection.add(1.0, "vtk/b.vtu")


def test_nothing_to_show_still_makes_valid_files(tmp_path):
    """No cracks, no tips, no contacts, no solved body: every file has all its arrays, a row each, or ParaView would
    forget them; its one cell is of the type that draws nothing, and `Run` reads no cell at all."""
    bare = {"cracks": Cracks.from_polylines([]), "tips": np.zeros(0, TIP), "faces": None, "bodies": {}}
    cycle = replace(made.cycle(0, 1, 0, 0, contacts=0), **bare)
    written_alone(tmp_path, cycle)
    for name in ("cracks", "tips", "contacts"):
        file = last_file(tmp_path, name)
        mesh = pv.read(file)
        assert (mesh.n_points, mesh.celltypes.tolist()) == (1, [0])
        assert (mesh.point_data["displacement"] == 0).all()
        assert mesh.bounds[:2] == (cycle.blocks.vertices[0, 0],) * 2
        read = read_grid(last_file(tmp_path, name))
        assert (read.n_points, read.n_cells) == (0, 0)
        assert {*mesh.point_data.keys(), *mesh.cell_data.keys()} == {field.name for field in SERIES[name]}
    assert pv.read(last_file(tmp_path, "blocks")).n_cells > 0
    assert not (tmp_path / "interior.pvd").exists()


def test_a_scene_without_a_load_is_written(tmp_path):
    written_alone(tmp_path, replace(made.cycle(0, 1, 0, 0), load=math.nan, strain=math.nan))
    mesh, other = pv.read(last_file(tmp_path, "blocks")), meshio.read(last_file(tmp_path, "blocks"))
    assert np.isnan(mesh.field_data["LOAD"][0])
    assert mesh.field_data["REFERENCE"][0] == 1
    assert np.isnan(other.field_data["LOAD"][0])
    assert other.field_data["TIME"][0] == 1.0


def test_cracks_nobody_solved_for_are_drawn_with_nan(tmp_path):
    cycle = made.cycle(1, 1, 0, 2)
    half = CrackFaces(*(getattr(cycle.faces, name)[:2] for name in
                        ("segment", "points", "opening", "slip", "traction", "state")))  # fmt: skip
    written_alone(tmp_path, replace(cycle, faces=half))
    mesh = pv.read(last_file(tmp_path, "cracks"))
    length = mesh.compute_cell_sizes(area=False, volume=False)["Length"].sum()
    assert math.isclose(length, cycle.cracks.lengths.sum(), rel_tol=1e-12)
    assert np.isnan(mesh["opening"]).sum() == 2 * (cycle.cracks.n_segments - 2)


def test_the_first_frame_shows_rock_at_rest(tmp_path):
    """Before the first step nothing is solved, and nothing is loaded: zeros, which scale bars can span, not nan."""
    cycle = replace(made.cycle(0, 0, 0, 1), faces=None, tips=np.zeros(0, TIP), bodies={})
    written_alone(tmp_path, cycle)
    cracks, tips = pv.read(last_file(tmp_path, "cracks")), pv.read(last_file(tmp_path, "tips"))
    for name in ("opening", "slip", "normal_traction", "shear_traction", "state"):
        assert not np.any(cracks[name]), name
    # The crack of the made-up run has grown straight up and straight down once.
    ends = np.array([[-1.0, -1.0], [1.0, 1.0]]) * made.HALF_LENGTH / math.sqrt(2) + [[0, -1e-3], [0, 1e-3]]
    assert np.allclose(tips.points[:, :2], ends, rtol=0, atol=1e-15)
    assert np.allclose(tips["growth_direction"], [[0, -1, 0], [0, 1, 0]], rtol=0, atol=1e-12)
    assert not np.any(tips["K_I"])


def test_a_cut_block_is_shown_before_and_after(tmp_path):
    """The interior of the last cycle before a cut is written, and the pieces after it, which have one stress each."""
    whole, load = made.cycle(5, 5, 0, 0), 5 * made.RATE
    parts = Blocks.from_polygons(
        [whole.blocks.loops(0), *made.halves(), whole.blocks.loops(2)],
        material=[1, 0, 0, 1],
        fixed=[True, False, False, False],
    )
    stress = np.zeros((4, 3))
    stress[:, 1] = [-load, -load, -1.5 * load, -load]
    state = replace(State.at_rest(parts), stress=stress, time=5.0 + 1e-3)
    none = {"cracks": Cracks.from_polylines([]), "tips": np.zeros(0, TIP), "faces": None, "bodies": {}}
    after = replace(whole, number=6, growth_pass=1, blocks=parts, state=state, **none)
    series = Series(interior_every=100)
    series.on_start(made.problem(), tmp_path)
    for cycle in (made.cycle(3, 3, 0, 0), made.cycle(4, 4, 0, 0), whole, after):
        series.on_cycle(cycle)
    series.on_end({})
    files = [file for _, file in read_collection(tmp_path / "interior.pvd")]
    assert [int(file.stem[-6:]) for file in files] == [3, 5, 6]  # (the made-up run begins at cycle 3)
    mesh = pv.read(files[-1])
    assert np.unique(mesh["block_id"]).tolist() == [1, 2]  # the rock, not the platens
    area = mesh.compute_cell_sizes(length=False, volume=False)["Area"].sum()
    assert math.isclose(area, parts.areas()[1:3].sum(), rel_tol=1e-12)
    of_point = np.zeros(mesh.n_points, int)
    of_point[mesh.cells.reshape(-1, 4)[:, 1:]] = mesh["block_id"][:, None]
    assert np.allclose(mesh["stress"][:, 1], np.where(of_point == 1, -load, -1.5 * load), rtol=1e-6)


def test_faces_of_an_open_bent_crack_part_by_opening_and_slip(tmp_path):
    """At the kinks of a crack in tension the two copies of a node must be apart by what the crack's own elements say
    there: the mean over the elements that meet, between which the discrete jump differs by a few per cent."""
    from scipy.spatial import cKDTree

    from geomech import ddm
    from geomech.conventions import normal_of

    line = 0.005 * np.array([[-2.5, -0.6], [-1.7, -0.5], [-1, -0.2], [0, 0], [1, 0.5], [1.25, 1.25], [1.3, 2.0]])
    cracks = Cracks.from_polylines([line])
    square = 0.03 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    body = ddm.Body([square], cracks, made.ROCK)
    sides = np.stack([square, np.roll(square, -1, axis=0)], axis=1)
    out = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    tension = 5e6 * np.repeat(out[:, None], 2, axis=1)
    solution = body.solve(ddm.BodyLoad(segments=sides, tractions=tension))
    blocks = Blocks.from_polygons([square])
    cycle = replace(
        made.cycle(1, 1, 0, 0), blocks=blocks, cracks=cracks, state=State.at_rest(blocks), bodies={0: solution}
    )
    grid = InteriorMeshes().grid(cycle, [made.ROCK], Motion.of(blocks, blocks.vertices), "reference")

    faces = solution.faces
    along = np.diff(line, axis=0)
    along /= np.hypot(*along.T)[:, None]
    jump = (
        faces.opening[..., None] * normal_of(along)[faces.segment, None]
        + faces.slip[..., None] * along[faces.segment, None]
    )
    jumps = cKDTree(faces.points.reshape(-1, 2))
    widest = np.hypot(*jump.reshape(-1, 2).T).max()
    moved = grid.point_data["displacement"][:, :2]
    for kink, normal in zip(line[1:-1], normal_of(along[1:] + along[:-1])):
        copies = np.flatnonzero(np.hypot(*(grid.points - kink).T) < 1e-12)
        assert len(copies) == 2
        cells = grid.connectivity.reshape(-1, 3)
        middle = [grid.points[cells[(cells == node).any(axis=1)]].mean(axis=(0, 1)) for node in copies]
        upper, lower = copies if (middle[0] - middle[1]) @ normal > 0 else copies[::-1]
        expected = jump.reshape(-1, 2)[jumps.query_ball_point(kink, 1e-12)].mean(axis=0)
        assert np.hypot(*expected) > 0.3 * widest
        # Measured 2.7 % of the widest opening at worst, at the sharp kink.
        assert np.hypot(*(moved[upper] - moved[lower] - expected)) < 0.04 * widest
    # Stress ends where the mesh does: Williams' field at the centres of the triangles about the tips, of which no
    # in-plane component exceeds (1.3 K_I + 1.8 K_II) / √(2πr), and not what the nodes' neighbourhood happens to hold.
    corners = grid.points[grid.connectivity.reshape(-1, 3)]
    tip = np.hypot(*(corners - line[-1]).transpose(2, 0, 1)).min(axis=1) < 1e-12
    r = np.hypot(*(corners[tip].mean(axis=1) - line[-1]).T).min()
    k = max(1.3 * abs(row["k_i"]) + 1.8 * abs(row["k_ii"]) for row in solution.tips)
    highest = np.abs(grid.point_data["stress"][:, [0, 1, 3]]).max()
    assert 0.3 * k < highest * math.sqrt(2 * math.pi * r) < k


def test_a_killed_run_leaves_a_readable_series(tmp_path):
    """SIGKILL in the middle of writing: the PVD parses and every file it names is whole."""
    import subprocess
    import sys
    import time

    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
        "import itertools, pathlib, synthetic_run as made\n"
        "from geomech.output import Histories, Series\n"
        f"folder = pathlib.Path({str(tmp_path)!r})\n"
        "watch = [Histories(), Series(interior_every=0)]\n"
        "for w in watch: w.on_start(made.problem(), folder)\n"
        "for k in itertools.count():\n"
        "    for w in watch: w.on_cycle(made.cycle(k, k, 0, 0))\n"
    )
    running = subprocess.Popen([sys.executable, "-c", code])
    try:
        deadline = time.monotonic() + 30
        # Each is renewed in its own time.
        pvds = [tmp_path / f"{name}.pvd" for name in ("blocks", "cracks", "tips", "contacts")]
        # Counted, not parsed: who reads across a page of a file in the very moment of a write may see half of it.
        while time.monotonic() < deadline and not all(
            p.exists() and p.read_bytes().count(b"<DataSet") > 21 for p in pvds
        ):
            time.sleep(0.05)
    finally:
        running.kill()
        running.wait()
    from geomech.output import Run

    for name in ("blocks", "cracks", "tips", "contacts"):
        entries = read_collection(tmp_path / f"{name}.pvd")
        assert len(entries) > 20
        for _, file in (entries[0], entries[-1]):
            assert pv.read(file).n_points > 0
    history = Run(tmp_path).history
    assert np.array_equal(history["cycle"], np.arange(len(history)))


def test_every_leaves_out_quiet_cycles_but_no_growth_and_not_the_last(tmp_path):
    made.write(tmp_path, [Series(every=10, interior_every=0)], steps=25, passes=0)
    numbers = [int(file.stem[-6:]) for _, file in read_collection(tmp_path / "blocks.pvd")]
    assert numbers == [0, 10, 20, 24]
    made.write(tmp_path, [Series(every=10, interior_every=0)], steps=5, passes=2)
    numbers = [int(file.stem[-6:]) for _, file in read_collection(tmp_path / "blocks.pvd")]
    assert numbers == [0, 5, 6]
    # The longer run before left nothing behind.
    assert len(list((tmp_path / "vtk").glob("blocks_*.vtu"))) == 3


def test_arrays_of_any_length_survive(tmp_path):
    """A grid left as it is, the last such and the first compressed one, several compressed pieces with and
    without a partial last one: all read back bit for bit."""
    row = sum(8 * (*f.shape, 1)[0] if f.dtype == "float64" else 4 for f in SERIES["tips"]) + 41
    last = (SMALL - 8) // row
    for n in (1, 7, last, last + 1, 1 << 16, (1 << 16) + 12345, 3):
        rng = np.random.default_rng(n)
        names = {f.name: rng.random((n, *f.shape)) for f in SERIES["tips"] if f.dtype == "float64"}
        names |= {f.name: rng.integers(0, 99, n) for f in SERIES["tips"] if f.dtype == "int32"}
        grid = Grid(rng.random((n, 2)), np.arange(n), np.arange(n) + 1, np.ones(n), names)
        GridFiles("tips").write(tmp_path / "tips.vtu", grid, {"CYCLE": 1})
        assert (b"compressor" in (tmp_path / "tips.vtu").read_bytes()[:200]) == (n > last)
        mesh, other = pv.read(tmp_path / "tips.vtu"), meshio.read(tmp_path / "tips.vtu")
        for name, data in names.items():
            assert np.array_equal(mesh[name], data)
            assert np.array_equal(np.asarray(other.point_data[name]).reshape(data.shape), data)


def test_large_grids_of_which_a_part_changes_are_read_back_as_they_are(tmp_path):
    """What stays is compressed once: whatever changes, and changes back, must be seen in each file."""
    n, files, rng = 5000, GridFiles("tips"), np.random.default_rng(1)
    kinds = {f.name: (f.dtype, f.shape) for f in SERIES["tips"]}
    names = {name: np.ones((n, *shape), dtype) for name, (dtype, shape) in kinds.items()}
    first = rng.random((n, 2))
    for changed, points in (("K_I", first), ("tip_id", first), ("K_I", first + 1.0), ("grown", first)):
        names[changed] = rng.random(n) if kinds[changed][0] == "float64" else rng.integers(0, 99, n)
        files.write(tmp_path / "tips.vtu", Grid(points, np.arange(n), np.arange(n) + 1, np.ones(n), names), {})
        mesh = pv.read(tmp_path / "tips.vtu")
        assert np.array_equal(mesh.points[:, :2], points)
        assert all(np.array_equal(mesh[name], data) for name, data in names.items())


def test_undeclared_and_missing_arrays_are_refused(tmp_path):
    grid = Grid(np.zeros((1, 2)), np.zeros(1), np.ones(1), np.ones(1), {"K_3": np.zeros(1)})
    with pytest.raises(ValueError, match=r"missing.*K_I.*undeclared \['K_3'\]"):
        GridFiles("tips").write(tmp_path / "tips.vtu", grid, {})


def written_alone(folder: Path, cycle, **options) -> None:
    series = Series(interior_every=1, **options)
    series.on_start(made.problem(), folder)
    series.on_cycle(cycle)
    series.on_end({})


@pytest.mark.parametrize("large", [0, 3000])
def test_large_grids_are_written_beside_the_run_to_the_same_bytes(tmp_path, monkeypatch, large):
    made.write(tmp_path / "at_once", [Series(interior_every=0)], steps=12, passes=2)
    # Below 3000 some series become large on the way, as their cracks grow.
    monkeypatch.setattr("geomech.output.vtk.series.LARGE", large)
    made.write(tmp_path / "beside", [Series(interior_every=0)], steps=12, passes=2)
    files = sorted(p.relative_to(tmp_path / "at_once") for p in (tmp_path / "at_once").rglob("*.[pv][vt][du]"))
    assert len(files) > 40
    for file in files:
        assert (tmp_path / "beside" / file).read_bytes() == (tmp_path / "at_once" / file).read_bytes(), file


@pytest.mark.parametrize("broken_off", [False, True])
def test_the_interior_of_many_moving_blocks_is_rare(tmp_path, broken_off):
    """With the first load, then ten times less often than for few blocks, and not before and after events; at the end, but
    where a run is broken off neither that nor what still waits to be written, for which it would have to wait."""
    series = Series(every=1000, interior_every=1)
    series.on_start(made.problem(), tmp_path)
    cycles = [replace(cycle, sparing=cycle.number > 0) for cycle in made.cycles(steps=104, passes=3)]
    assert any(cycle.events for cycle in cycles[102:-1])
    for cycle in cycles:
        series.on_cycle(cycle)
    series.on_end({}, KeyboardInterrupt() if broken_off else None)
    listed = tmp_path / "interior.pvd"
    assert broken_off or listed.exists()
    written = [int(file.stem[-6:]) for _, file in read_collection(listed)] if listed.exists() else []
    due = [0, 1, 101, cycles[-1].number]
    assert written == (due[: min(len(written), 3)] if broken_off else due)


def test_fields_that_nobody_waits_for_end_before_the_next_block():
    meshes, problem = InteriorMeshes(), made.problem()
    cycle = next(cycle for cycle in made.cycles(steps=2, passes=0) if cycle.inside)
    meshes.stop()
    with pytest.raises(Stopped):
        meshes.grid(cycle, problem.materials, cycle.motion, "reference")


def test_interior_fields_that_an_interrupt_leaves_are_written_by_the_resumed_run(tmp_path, monkeypatch):
    """The first two, of cycles 0 and 1, wait until the run is interrupted; the files are those of one run to the end."""
    cycles = [replace(cycle, sparing=cycle.number > 0) for cycle in made.cycles(steps=6, passes=0)]
    straight, series, later = (Series(interior_every=1) for _ in range(3))
    straight.on_start(made.problem(), tmp_path / "straight")
    for cycle in cycles:
        straight.on_cycle(cycle)
    straight.on_end({})

    grid, go_on = InteriorMeshes.grid, threading.Event()

    def late(self, *given):
        go_on.wait(10.0)
        return grid(self, *given)

    monkeypatch.setattr(InteriorMeshes, "grid", late)
    series.on_start(made.problem(), tmp_path / "parts")
    for cycle in cycles[:3]:
        series.on_cycle(cycle)
    series.on_interrupt()
    go_on.set()
    memory = series.memory()
    assert [cycle.number for cycle, _ in memory["_left"]] == [0, 1]
    series.on_end({}, KeyboardInterrupt())
    assert not (tmp_path / "parts" / "interior.pvd").exists()
    memory["_meshes"] = copy(memory["_meshes"])  # as a checkpoint has it
    later.on_resume(made.problem(), tmp_path / "parts", memory)
    for cycle in cycles[3:]:
        later.on_cycle(cycle)
    later.on_end({})
    files = sorted(p.relative_to(tmp_path / "straight") for p in (tmp_path / "straight").rglob("*.[pv][vt][du]"))
    assert [file.name for file in files if file.name.startswith("interior_")]
    for file in files:
        assert (tmp_path / "parts" / file).read_bytes() == (tmp_path / "straight" / file).read_bytes(), file
