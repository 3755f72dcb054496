"""Pictures of fields of the made-up run: values against its closed forms, what stands where on the picture, bad wishes.

Pixels are compared with what the run knows: colours along the specimen follow its displacement, and the legend's strip
holds nothing of the model.
"""

import imageio.v3 as imageio
import numpy as np
import pytest
import synthetic_run as made

from geomech.cli import main
from geomech.output import Histories, Run, Series, Summary
from geomech.render.fields.draw import PictureRequest, draw_field, usual_field
from geomech.render.fields.frame import Frames
from geomech.render.fields.painter import FieldPainter, view
from geomech.render.fields.quantity import UnknownField, limits, quantity, readable

LOAD = 3 * made.RATE


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    made.write(folder, [Histories(), Series(interior_every=1), Summary()])
    return Run(folder)


def test_spans_are_those_of_the_run_in_si_units(run):
    assert limits([run], quantity(run, "force")) == pytest.approx((0.0, LOAD * np.hypot(0.01, 0.03)))
    assert limits([run], quantity(run, "K")) == pytest.approx((0.0, 1.15 * 0.0586 * LOAD))
    low, high = limits([run], quantity(run, "yy"))
    assert (low, high) == pytest.approx((-LOAD, 0.0), rel=1e-5, abs=1.0)
    assert limits([run], quantity(run, "yy", compression_positive=True)) == pytest.approx((0.0, LOAD), rel=1e-5, abs=1)
    assert limits([run], quantity(run, "opening"))[1] > 0
    assert limits([run], quantity(run, "contacts.shear_force")) == pytest.approx((-0.01 * LOAD, 0.01 * LOAD), rel=0.02)


@pytest.mark.parametrize(
    ("value", "unit", "told"),
    [(0.129, "m", "mm"), (3.2, "m", "m"), (8.7e5, "N/m", "kN/m"), (2e6, "Pa √m", "MPa √m"), (3e-5, "m/s", "µm/s")],
)
def test_units_are_read_easily(value, unit, told):
    name, size = readable(unit, value)
    assert name == told and 1 <= value / size < 1000


def test_between_two_cycles_blocks_are_as_far_as_their_mean_speed_takes_them(run):
    frames = Frames(run)
    early, late, between = (frames.grid("blocks", t)["displacement"] for t in (1.0, 2.0, 1.25))
    assert np.allclose(between, 0.75 * early + 0.25 * late, rtol=0, atol=1e-18) and np.abs(late - early).max() > 1e-7


def test_colours_follow_the_displacement(run):
    """The specimen is shortened evenly about its middle and lifted by 1 mm, so that colours change with height alone."""
    what = quantity(run, "displacement")
    painter = FieldPainter(run, what, view(run, what, scale=1.0, size=(400, None)))
    painter.draw(3.0)
    image = painter.image().astype(int)
    axes = painter.figure.axes[0]
    height = image.shape[0]

    def colour(x, y):
        across, up = axes.transData.transform((x, y))
        return image[height - 1 - round(up), round(across)]

    for y in (-0.03, 0.03):
        assert np.abs(colour(-0.012, y) - colour(0.015, y)).max() <= 3
    assert axes.bbox.x1 < painter.figure.axes[1].bbox.x0  # the legend stands beside the model
    assert axes.bbox.y0 > painter.figure.axes[2].bbox.y1
    assert height == pytest.approx(painter.figure.bbox.height)


@pytest.mark.first_by_default(5)
@pytest.mark.parametrize(
    "field", ["slip", "opening", "force", "K", "principal", "velocity.Y", "bolts.force", "blocks.material"]
)
def test_every_kind_of_field_is_drawn(run, tmp_path, field):
    (path,) = draw_field([run], PictureRequest(field=field, size=(300, None)), tmp_path)
    assert path.name == f"{field}.png" and imageio.imread(path).std() > 10


def test_compared_runs_share_their_colours(run, tmp_path):
    made.write(tmp_path / "short", [Histories(), Series(interior_every=0), Summary()], steps=2, passes=0)
    other = Run(tmp_path / "short")
    seen = []

    class Seen(FieldPainter):
        def __init__(self, *given):
            super().__init__(*given)
            seen.append(self.view.limits)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("geomech.render.fields.draw.FieldPainter", Seen)
        draw_field([run, other], PictureRequest(field="force", size=(200, None)), tmp_path / "out")
    assert seen[0] == seen[1] == limits([run], quantity(run, "force"))


def test_a_movie_is_even_in_time(run, tmp_path):
    drawn = []

    class Seen(FieldPainter):
        def draw(self, time):
            drawn.append(time)
            super().draw(time)

    from geomech.render.fields.even_movie import even_movie

    what = quantity(run, "displacement")
    paths = even_movie(Seen(run, what, view(run, what, size=(200, None))), [tmp_path / "m.gif"], frames=5)
    first, last = Frames(run).span()
    assert drawn == pytest.approx(np.linspace(first, last, 5))
    assert len(imageio.imread(paths[0], index=None)) == 5
    assert (np.asarray(imageio.imread(paths[0], index=0))[0, 0, :3] == 255).all()


def test_what_suits_a_run(run, tmp_path):
    assert usual_field(run) is None  # stress inside cracked rock
    made.write(tmp_path, [Histories(), Series(interior_every=0), Summary()])
    assert usual_field(Run(tmp_path)) == "displacement"


def test_wishes_that_cannot_be_met_are_reported(run, tmp_path, capsys):
    with pytest.raises(UnknownField, match=r"no field 'heat'; there are displacement, .*contacts\.gap"):
        quantity(run, "heat")
    with pytest.raises(UnknownField, match=r"is a tensor: name a component, as stress\.XX"):
        quantity(run, "blocks.stress")
    with pytest.raises(UnknownField, match="has the components X, Y, Z"):
        quantity(run, "velocity.Q")
    folder = str(run.folder)
    for wishes, told in (
        (["--time", "99"], "has output from t = 0 s"),
        (["--field", "heat"], "no field 'heat'"),
        (["--range", "2", "1"], "--range runs from a lower"),
        (["--scale", "-1"], "--scale is a factor of 0 or more"),
        (["--size", "big"], "--size is a width"),
    ):
        assert main(["render", folder, *wishes]) != 0
        assert told in capsys.readouterr().err
    assert main(["render", str(tmp_path / "none"), "--field", "K"]) != 0
    assert "there is no folder" in capsys.readouterr().err


def test_bolts_and_joints_have_curves(run, tmp_path):
    from geomech.render.curves.plots import plots
    from geomech.render.curves.structure_curves import bolt_curves, joint_curves

    (curve,) = bolt_curves(run).values()
    assert curve[:4].tolist() == [[t, 1e-3 * made.RATE * t] for t in range(4)]
    assert "bolts.png" in [path.name for path in plots(run, tmp_path, more=True)]
    assert joint_curves(run) == {}  # the made-up run sums up no joints
    (tmp_path / "history.csv").write_text((run.folder / "history.csv").read_text())
    header = "cycle,time,joint,mean_slip\n"
    (tmp_path / "joints.csv").write_text(header + "0,0,bedding,0\n0,0,fault,0\n1,0.5,bedding,1e-3\n1,0.5,fault,-2e-3\n")
    curves = joint_curves(Run(tmp_path))
    assert list(curves) == ["fault", "bedding"] and curves["fault"].tolist() == [[0.0, 0.0], [0.5, 2e-3]]
