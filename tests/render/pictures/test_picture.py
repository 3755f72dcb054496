"""Pictures held against what they must show: where the rock is, where the crack is, which colours stand where.

A picture is measured in pixels; positions follow from the layout within two of them.
"""

from __future__ import annotations

import csv
import shutil

import numpy as np
import pytest
import synthetic_run as made

from geomech.output import Histories, Run, Series, Summary
from geomech.render import draw
from geomech.render.curves.crack_curves import length_ever, stress_intensity, tip_curves
from geomech.render.curves.plots import plots
from geomech.render.movie import moments
from geomech.render.pictures import offscreen
from geomech.render.pictures.field import COMPONENTS, agreeing, face_displacements, interior_grid, values
from geomech.render.pictures.legend import ticks
from geomech.render.pictures.look import final_cycle, look
from geomech.render.pictures.picture import picture
from geomech.report.table import table

imageio = pytest.importorskip("imageio.v3")
pytestmark = pytest.mark.skipif(offscreen.usable_window() is None, reason="no off-screen OpenGL here")


@pytest.fixture(scope="module")
def drawn(drawn_run, tmp_path_factory):
    out = tmp_path_factory.mktemp("pictures")
    return {path.name: path for path in draw(drawn_run, out)}


def test_everything_is_drawn_at_the_scenes_width(drawn):
    curves = ["stress_strain.png", "stress_intensity.png", "crack_length.png"]
    assert list(drawn) == ["specimen.png", "growth.gif", *curves]
    image = imageio.imread(drawn["specimen.png"])
    assert image.shape[1] == 500
    assert (image[:3] == 255).all()  # white margins


def test_rock_hole_notch_and_crack_are_where_they_should_be(drawn_run, tmp_path):
    """Undeformed, 1 m is so many pixels: the crack is dark at the origin, the hole and the notch are white."""
    fixed = look(drawn_run, 5, scale=0.0, width=1000)
    image = imageio.imread(picture(drawn_run, tmp_path / "a.png", fixed, 5)).astype(int)
    ink = (image < 250).any(axis=2)
    # The platens' lower edge: the lowest row with ink right across; bounds are those of the blocks.
    x0, x1, y0, y1 = fixed.bounds
    assert (x0, x1, y0, y1) == pytest.approx((-0.03, 0.03, -0.07, 0.07))
    bottom = np.flatnonzero(ink.sum(axis=1) > 200)[-1]
    row = np.flatnonzero(ink[bottom - 5, :700])
    pixels_per_metre = (row[-1] - row[0]) / (x1 - x0)

    def at(x, y):
        return image[round(bottom - (y - y0) * pixels_per_metre), round(row[0] + (x - x0) * pixels_per_metre)]

    assert (at(-0.0175, -0.0375) == 255).all()  # the hole
    assert (at(0.0285, 0.0) == 255).all()  # the notch
    assert at(0.0, 0.0).max() < 60  # the flaw, black
    assert np.ptp(at(0.0, 0.065)) < 10  # the platen, grey: another material than the solved specimen
    assert np.ptp(at(0.0, 0.03)) > 40  # the rock, in colour


def test_movie_grows_to_the_last_picture(drawn, drawn_run):
    """Frames are the cycles whose interior is that of their own cracks: after the first load it comes with growth."""
    frames = imageio.imread(drawn["growth.gif"])
    assert moments(drawn_run, 48) == [0, 1, 6, 8, 9]
    assert len(frames) == 5
    orange = [((f[..., 0] > 200) & (f[..., 1] > 80) & (f[..., 2] < 90))[:, :330].sum() for f in frames]
    assert orange[0] == 0
    assert orange[-1] > 20  # the younger pieces of crack


def test_frames_share_their_colours(drawn):
    """A platen is the same grey in every frame, and what stands still has the same pixels."""
    frames = np.array([np.asarray(frame)[..., :3] for frame in imageio.imread(drawn["growth.gif"])], dtype=int)
    image = imageio.imread(drawn["specimen.png"]).astype(int)
    grey = (np.abs(image[..., :3] - (0xE4, 0xE4, 0xE1)) <= 1).all(axis=2)
    assert grey.sum() > 2000
    assert np.abs(frames[:, grey] - (0xE4, 0xE4, 0xE1)).max() <= 4
    # 256 colours for everything: a shade is missed by no more than the eye sees.
    assert np.percentile(np.abs(frames[-1][::3, ::3] - frames[-2][::3, ::3]), 50) == 0


def test_between_two_fields_of_the_same_cracks_lies_their_mean(tmp_path):
    """Loading of one crack is linear in the made-up run, so what is interpolated is what would have been written."""
    made.write(tmp_path, [Histories(), Series(interior_every=1), Summary()], steps=21, passes=0)
    run = Run(tmp_path)
    assert list(run.grids("interior")) == [0, 1, 11, 20]
    assert agreeing(run, range(21)) == list(range(21))
    grid = interior_grid(run, 4)
    assert np.allclose(grid["stress"][:, 1], -4 * made.RATE, rtol=1e-6)
    made.write(tmp_path, [Histories(), Series(interior_every=1), Summary()], steps=3, passes=0)
    assert list(Run(tmp_path).grids("interior")) == [0, 1, 2]


def test_cracks_lie_between_the_faces_of_the_deformed_rock(drawn_run):
    """The lines are displaced as the torn mesh is: by the closed form of the made-up motion, not by a block's mean."""
    cracks, interior = drawn_run.grid("cracks", 9), drawn_run.grid("interior", 9)
    upper, lower = face_displacements(interior, cracks)
    expected = made.placement(cracks.points[:, :2], 5 * made.RATE, 0.0) - cracks.points[:, :2]
    for face in (upper, lower):
        assert np.allclose(face[:, :2], expected, rtol=0, atol=1e-8)


def test_the_faces_of_a_torn_rock_are_told_apart():
    """A square cut from its left side to its middle, whose upper half stands 1 above the lower."""
    import pyvista as pv

    points = np.array([[-1, 0], [0, 0], [1, 0], [1, 1], [-1, 1], [-1, -1], [1, -1], [-1, 0]], dtype=float)
    triangles = np.array([[0, 1, 4], [1, 3, 4], [1, 2, 3], [5, 1, 7], [5, 6, 1], [6, 2, 1]])
    rock = pv.UnstructuredGrid(
        np.column_stack([np.full(6, 3), triangles]).ravel(), np.full(6, 5), np.column_stack([points, np.zeros(8)])
    )
    rock["displacement"] = np.zeros((8, 3))
    rock["displacement"][0] = (0, 1, 0)
    line = pv.UnstructuredGrid([2, 0, 1, 2, 1, 2], [3, 3], np.array([[-0.75, 0, 0], [-0.25, 0, 0], [0.5, 0, 0]]))
    upper, lower = face_displacements(rock, line)
    assert np.allclose(upper[:2, 1], [0.75, 0.25])
    assert np.allclose(lower[:2], 0)
    assert np.isnan(upper[2]).all()
    # Against the line's direction the faces change places.
    turned = pv.UnstructuredGrid([2, 1, 0], [3], line.points[:2])
    assert np.allclose(face_displacements(rock, turned)[1][:, 1], [0.75, 0.25])


def test_a_run_that_ends_with_a_cut_is_shown_before_it(tmp_path):
    from dataclasses import replace

    from geomech.model import TIP, Cracks

    none = {"cracks": Cracks.from_polylines([]), "tips": np.zeros(0, TIP), "faces": None, "bodies": {}}
    cut = replace(made.cycle(6, 3, 3, 2), **none)
    later = replace(made.cycle(7, 4, 0, 2), **none)
    for name, cycles, shown in (("cut", [cut], 5), ("cut and on", [cut, later], 7)):
        folder = tmp_path / name
        for watch in (watchers := [Histories(), Series(), Summary()]):
            watch.on_start(made.problem(), folder)
            for cycle in [*made.cycles(4, 2), *cycles]:
                watch.on_cycle(cycle)
        for watch in watchers:
            watch.on_end({})
        assert final_cycle(Run(folder)) == shown


def test_tips_with_the_same_curve_share_one(drawn_run):
    """The made-up crack has the same factors at both its ends."""
    ((members, load, k_i, _, _),) = tip_curves(drawn_run)
    assert members == [(0, 0), (0, 1)]
    assert np.allclose(k_i, -0.0626 * load, rtol=1e-9)


def test_of_many_tips_those_that_grow_are_named(drawn_run):
    """Thirty tips with factors of their own, of which one grows and one, at a thread of rock, has a factor of 1e6: the
    legend names a few, and neither it nor the runaway is larger than the page."""
    from matplotlib.figure import Figure

    own = drawn_run.tips[(drawn_run.tips["crack"] == 0) & (drawn_run.tips["end"] == 0)]
    tips = np.concatenate([own] * 30)
    tips["crack"] = np.repeat(np.arange(30), len(own))
    for name in ("K_I", "K_II"):
        tips[name] *= np.repeat(1 + np.arange(30) / 10, len(own))
    tips["K_I"][-len(own) :] *= 1e6
    tips["grown_m"] = np.where(tips["crack"] == 7, 1e-3, 0.0)
    run = Run(drawn_run.folder)
    vars(run)["tips"] = tips
    axes = Figure().add_subplot()
    stress_intensity(axes, run)
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "crack 7, start" in labels and "24 more tips" in labels and len(labels) == 10
    # The toughness, 2 MPa√m, is far above all others.
    assert 2.0 < np.abs(axes.get_ylim()).max() < 10.0
    assert any("beyond the page" in text.get_text() for text in axes.texts)


def test_length_goes_on_being_counted_where_cracks_become_faces(drawn_run):
    """Two metres of crack, of which one becomes faces while a tip elsewhere grows by a tenth of a metre."""
    run = Run(drawn_run.folder)
    history = drawn_run.history[:4].copy()
    history["crack_length"] = [2.0, 2.3, 1.4, 1.5]
    tips = np.zeros(2, drawn_run.tips.dtype)
    tips["cycle"], tips["grown_m"] = history["cycle"][[0, 1]], [0.3, 0.1]
    vars(run).update(history=history, tips=tips)
    assert np.allclose(length_ever(run), [2.0, 2.3, 2.4, 2.5], rtol=1e-12)


def test_moments_prefer_growth(tmp_path):
    made.write(tmp_path, [Histories(), Series(interior_every=0), Summary()], steps=80, passes=30)
    chosen = moments(Run(tmp_path), 24)
    assert len(chosen) <= 26
    assert chosen[0] == 0
    assert chosen[-1] == 109
    assert sum(cycle >= 80 for cycle in chosen) >= 14


def test_colours_end_at_percentiles_of_the_area(drawn_run):
    """A uniform field gets a band about its value; unknown names are refused with the known ones."""
    low, high = look(drawn_run, 9).limits
    assert low < -5 * made.RATE / 1e6 < high
    assert (high - low) == pytest.approx(0.1 * 5 * made.RATE / 1e6, rel=1e-3)
    with pytest.raises(KeyError, match="von_mises"):
        look(drawn_run, 9, component="mises")


def test_automatic_magnification_is_a_round_number(drawn_run):
    scale = look(drawn_run, 9).scale
    spread = np.ptp(drawn_run.grid("blocks", 9)["displacement"], axis=0).max()
    assert 0.02 * 0.14 < scale * spread < 0.05 * 0.14
    assert scale == float(f"{scale:.1g}")


def test_magnification_does_not_draw_blocks_inside_one_another():
    """A block that has slid a thousandth of its width towards a wall a hundredth away: fifteen times is no
    overlap of more than a line's width, sixty times would be. What overlaps as it is does not count."""
    import pyvista as pv

    from geomech.render.pictures.look import OVERLAP, _magnification
    from geomech.render.pictures.overlaps import overlap

    def drawn(shift: float) -> pv.UnstructuredGrid:
        x = np.array([0.0, 1.0, 1.0, 0.0])
        points = np.concatenate([np.stack([x + at, [0, 0, 1, 1], 0 * x], axis=1) for at in (0.0, 1.01)])
        triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
        cells = np.column_stack([np.full(4, 3), triangles]).ravel()
        grid = pv.UnstructuredGrid(cells, np.full(4, pv.CellType.TRIANGLE), points)
        grid["block_id"] = np.array([0, 0, 1, 1])
        grid["displacement"] = np.where(np.arange(8)[:, None] < 4, [shift, 0.0, 0.0], 0.0)
        return grid

    grid = drawn(1e-3)
    assert 1.0 < _magnification([grid], 2.01) <= 15.0
    assert not overlap([grid], _magnification([grid], 2.01), OVERLAP * 2.01) and overlap([grid], 60.0, OVERLAP * 2.01)
    assert _magnification([drawn(0.02)], 2.01) == 3.0


def test_a_scene_without_cracks_and_interior_is_drawn(tmp_path):
    from dataclasses import replace

    from geomech.model import TIP, Cracks

    bare = {"cracks": Cracks.from_polylines([]), "tips": np.zeros(0, TIP), "faces": None, "bodies": {}}
    cycle = replace(made.cycle(0, 5, 0, 0, contacts=0), **bare)
    for watch in (watchers := [Histories(), Series(configuration="current"), Summary()]):
        watch.on_start(made.problem(), tmp_path)
        watch.on_cycle(cycle)
    for watch in watchers:
        watch.on_end({})
    paths = draw(Run(tmp_path), component="von_mises", width=400)
    assert [path.name for path in paths] == ["specimen.png"]
    assert imageio.imread(paths[0]).std() > 10


def test_opening_can_colour_the_cracks(drawn_run, tmp_path):
    fixed = look(drawn_run, 9, crack_colour="opening", width=400)
    assert fixed.crack_limits[1] == pytest.approx(5 * made.RATE * 1e-13 * 0.5 * 1e6, rel=1e-6)
    assert picture(drawn_run, tmp_path / "o.png", fixed, 9).stat().st_size > 5000


@pytest.mark.parametrize("component", COMPONENTS)
def test_every_component_has_values(drawn_run, component):
    for name in ("interior", "blocks"):
        assert np.isfinite(values(drawn_run.grid(name, 9), component)).all()
    # Uniaxial: von Mises in plane strain is σ √(1 − ν + ν²).
    if component == "von_mises":
        grid = drawn_run.grid("interior", 9)
        assert np.allclose(values(grid, component), np.asarray(grid["von_mises"]) / 1e6, rtol=1e-5)


def test_ticks_are_round_and_inside():
    assert ticks(-48.2, 3.1, 6) == [-40.0, -30.0, -20.0, -10.0, 0.0]
    assert ticks(0.0, 1.0, 5) == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert ticks(3, 6, 20, whole=True) == [3, 4, 5, 6]
    # Never one number alone, which would be no scale.
    assert ticks(-0.77, -0.03, 4) == pytest.approx([-0.6, -0.4, -0.2])
    assert ticks(8, 92, 2, whole=True) == [20, 40, 60, 80]


def test_what_nothing_leads_is_drawn_against_time(drawn_run, tmp_path):
    """A scene without a leading edge has a load of 0 throughout: no load is told, and curves go over time."""
    folder = tmp_path / "run"
    shutil.copytree(drawn_run.folder, folder)
    for name in ("history.csv", "tips.csv", "events.csv"):
        with open(folder / name, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        with open(folder / name, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(row | {"load": "0.0"} for row in rows)
    run = Run(folder)
    assert drawn_run.led and not run.led
    paths = plots(run, tmp_path, suffix=".svg")
    assert [path.name for path in paths] == ["stress_intensity.svg", "crack_length.svg"]
    (row,) = table([run])
    assert row["initiation MPa"] is row["peak MPa"] is row["initiation σ√(πb)/K_Ic"] is None


def test_curves_need_no_opengl(drawn_run, tmp_path):
    assert [path.name for path in plots(drawn_run, tmp_path)] == [
        "stress_strain.png", "stress_intensity.png", "crack_length.png"
    ]  # fmt: skip


def test_missing_opengl_is_told_with_the_way_out(monkeypatch):
    monkeypatch.setattr(offscreen, "usable_window", lambda: None)
    with pytest.raises(offscreen.RenderingUnavailable, match="apt-get install -y libegl1"):
        offscreen.ready()
