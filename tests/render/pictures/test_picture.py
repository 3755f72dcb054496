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
from geomech.render.fields.draw import draw_end, suited
from geomech.render.fields.painter import FieldPainter, suitable_scale, view
from geomech.render.fields.quantity import limits, quantity
from geomech.render.movie import moments
from geomech.render.pictures.field import COMPONENTS, agreeing, face_displacements, interior_grid
from geomech.render.pictures.look import crack_limits, final_cycle, rock_colours
from geomech.report.table import table

imageio = pytest.importorskip("imageio.v3")


@pytest.fixture(scope="module")
def drawn(drawn_run, tmp_path_factory):
    out = tmp_path_factory.mktemp("pictures")
    return {path.name: path for path in draw(drawn_run, out)}


def test_everything_is_drawn_at_the_scenes_width(drawn):
    curves = ["stress_strain.png", "stress_intensity.png", "crack_length.png"]
    assert list(drawn) == ["specimen.png", "growth.gif", "K.png", *curves]
    image = imageio.imread(drawn["specimen.png"])
    assert image.shape[1] == 500 == imageio.imread(drawn["K.png"]).shape[1]
    assert (image[:3] == 255).all()  # white margins


def pixels_of(painter, cycle):
    """(x, y) m → colour of the picture of ``cycle``."""
    painter.draw(painter.frames.cycle_time(cycle))
    image, axes = painter.image().astype(int), painter.figure.axes[0]

    def at(x, y):
        across, up = axes.transData.transform((x, y))
        return image[image.shape[0] - 1 - round(up), round(across)]

    return at


def test_rock_hole_notch_and_crack_are_where_they_should_be(drawn_run):
    """Undeformed: the crack is dark at the origin, the hole and the notch are white, the rock has the colour of its
    stress."""
    painter = suited(drawn_run, "yy", width=1000)
    assert painter.view.bounds == pytest.approx((-0.03, 0.03, -0.07, 0.07))
    at = pixels_of(painter, 5)
    assert (at(-0.0175, -0.0375) == 255).all()  # the hole
    assert (at(0.0285, 0.0) == 255).all()  # the notch
    assert at(0.0, 0.0).max() < 60  # the flaw, black
    assert np.ptp(at(0.0, 0.065)) < 25  # the platen, plain: another material than the solved specimen
    low, high = painter.view.limits
    stress = float(np.mean(drawn_run.grid("interior", 5)["stress"][:, 1]))
    colour = np.array(rock_colours(low, high)((stress - low) / (high - low))[:3])
    assert np.abs(at(0.004, 0.03) - 255 * colour).max() <= 3


def test_movie_grows_to_the_last_picture(drawn, drawn_run):
    """Frames are the cycles whose interior is that of their own cracks: after the first load it comes with growth."""
    frames = imageio.imread(drawn["growth.gif"])
    assert moments(drawn_run, 48) == [0, 1, 6, 8, 9]
    assert len(frames) == 5
    orange = [((f[..., 0] > 200) & (f[..., 1] > 80) & (f[..., 2] < 90))[:, :330].sum() for f in frames]
    assert orange[0] == 0
    assert orange[-1] > 20  # the younger pieces of crack


def test_frames_share_their_colours(drawn):
    """What stands still has the same pixels in the last frames, and the last one is the picture."""
    frames = np.array([np.asarray(frame)[..., :3] for frame in imageio.imread(drawn["growth.gif"])], dtype=int)
    image = imageio.imread(drawn["specimen.png"]).astype(int)[..., :3]
    # 256 colours for everything: a shade is missed by no more than the eye sees.
    assert np.percentile(np.abs(frames[-1] - image), 99) <= 12
    assert np.percentile(np.abs(frames[-1] - frames[-2]), 50) == 0


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
    assert any("above the range" in text.get_text() for text in axes.texts)


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
    """From rock at rest to the stress at the end, which is even; unknown names are refused with the known ones."""
    low, high = limits([drawn_run], quantity(drawn_run, "yy"))
    assert high == 0.0 and low == pytest.approx(-5 * made.RATE, rel=1e-3)
    with pytest.raises(KeyError, match="von_mises"):
        suited(drawn_run, "mises")


def test_colours_can_be_read_in_grey():
    """Of a span on one side of zero darkness grows with size all along."""
    for span in ((-4.0, 0.0), (0.0, 4.0)):
        shades = rock_colours(*span)(np.linspace(0, 1, 64))[:, :3] @ (0.299, 0.587, 0.114)
        steps = np.diff(shades) if span[0] < 0 else -np.diff(shades)
        assert steps.min() > 0 and abs(shades[-1] - shades[0]) > 0.7
    middle = rock_colours(-4.0, 2.0)(4 / 6)[:3]
    assert min(middle) > 0.95  # zero is white


def test_automatic_magnification_is_a_round_number(drawn_run):
    scale = suitable_scale(drawn_run)
    spread = np.ptp(drawn_run.grid("blocks", 9)["displacement"], axis=0).max()
    assert 0.02 * 0.14 < scale * spread < 0.05 * 0.14
    assert scale == float(f"{scale:.1g}")


def test_magnification_does_not_draw_blocks_inside_one_another():
    """A block that has slid a thousandth of its width towards a wall a hundredth away: fifteen times is no
    overlap of more than a line's width, sixty times would be. What overlaps as it is does not count."""
    import pyvista as pv

    from geomech.render.pictures.look import OVERLAP, magnification
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
    assert 1.0 < magnification([grid], 2.01) <= 15.0
    assert not overlap([grid], magnification([grid], 2.01), OVERLAP * 2.01) and overlap([grid], 60.0, OVERLAP * 2.01)
    assert magnification([drawn(0.02)], 2.01) == 3.0


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
    assert crack_limits(drawn_run, 9, "opening")[1] == pytest.approx(5 * made.RATE * 1e-13 * 0.5 * 1e6, rel=1e-6)
    what = quantity(drawn_run, "yy")
    painter = FieldPainter(drawn_run, what, view(drawn_run, what, size=(400, None)), "opening")
    assert draw_end(painter, tmp_path / "o.png").stat().st_size > 5000
    labels = [axes.get_ylabel() for axes in painter.figure.axes]
    assert "opening, µm" in labels
    with pytest.raises(KeyError, match="there are birth, opening"):
        crack_limits(drawn_run, 9, "age")


@pytest.mark.parametrize("component", COMPONENTS)
def test_every_component_has_values(drawn_run, component):
    what = quantity(drawn_run, component)
    for name in ("interior", "blocks"):
        assert np.isfinite(what.values(name, drawn_run.grid(name, 9))[0]).all()
    # Uniaxial: von Mises in plane strain is σ √(1 − ν + ν²).
    if component == "von_mises":
        grid = drawn_run.grid("interior", 9)
        s1, s2, s3 = np.asarray(grid["principal_stress"], float).T
        expected = np.sqrt(0.5 * ((s1 - s2) ** 2 + (s2 - s3) ** 2 + (s3 - s1) ** 2))
        assert np.allclose(what.values("interior", grid)[0], expected, rtol=1e-5)


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
