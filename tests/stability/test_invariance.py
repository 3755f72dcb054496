"""A coupled run does not know where it stands, which way it looks, in what units or in what order it was written.

A specimen with two open cracks at 45° is pressed to 52 MPa in three steps and grows its wings on the way. The moved,
turned, scaled or renumbered specimen must do the same. Tips are compared in units of a crack's length, K in units of
the largest one.
"""

import numpy as np
import pytest

from geomech.coupling import cycles
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from geomech.reference.specimens.two_cracks import crack_ends

W, H, OVER, THICK, CRACK = 0.03, 0.06, 0.005, 0.01, 0.01
RATE = 0.2e6


def rectangle(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def specimen(platens, turn=None, shift=(0.0, 0.0), length=1.0, stress=1.0, order=(0, 1, 2), flip_cracks=False):
    """The specimen after x → length · turn · x + shift, with stresses in units 1/``stress`` as large; ``order`` is the
    place of rock, top and bottom among the blocks."""
    turn = np.eye(2) if turn is None else turn

    def at(points):
        return length * np.asarray(points) @ turn.T + np.asarray(shift)

    rock, bottom = rectangle(-W, -H, W, H), rectangle(-W - OVER, -H - THICK, W + OVER, -H)
    # Loaded over the specimen's width only.
    loaded = [[W, H + THICK], [-W, H + THICK]]
    top = np.insert(rectangle(-W - OVER, H, W + OVER, H + THICK), 3, loaded, axis=0)
    own = [""] * 4 if platens else ["load:bottom", "", "load:top", ""]
    names = [own, ["", "", "", "load:top", "", ""], [""] * 4]
    polygons, material, fixed = [rock, top, bottom], [0, 1, 1], [False, False, True]
    held = np.zeros((3, 6), bool)
    across = 0 if abs(turn[0, 1]) < 0.5 else 1  # the top runs along the load's axis only and neither turns nor shears
    held[1, [across, 2, 5]] = True
    chosen = sorted(range(3), key=lambda b: order[b]) if platens else [0]
    blocks = Blocks.from_polygons(
        [at(polygons[b]) for b in chosen],
        material=[material[b] for b in chosen],
        fixed=[fixed[b] for b in chosen],
        constrained=held[chosen],
        edge_names=[[names[b]] for b in chosen],
    )
    lines = [at(line) for line in crack_ends(45.0)]
    if flip_cracks:
        lines = [line[::-1] for line in lines[::-1]]
    home = chosen.index(0)
    down = stress * turn @ np.array([0.0, -RATE])
    loads = [EdgeTraction("load:top", History.ramp(down))]
    if not platens:
        loads.append(EdgeTraction("load:bottom", History.ramp(-down)))
    # Density goes with stress × time² / length²: statics with time steps has a little inertia in it.
    inertia = stress / length**2
    return Problem(
        title="specimen",
        blocks=blocks,
        cracks=Cracks.from_polylines(lines, aperture=np.inf, block=home),
        materials=(
            Material("rock", 17e9 * stress, 0.21, 2200.0 * inertia, 2e6 * stress * np.sqrt(length)),
            Material("steel", 200e9 * stress, 0.3, 7800.0 * inertia),
        ),
        joints=(JointLaw("smooth"),),
        loads=Loads(edge_tractions=tuple(loads)),
        dda=DdaSettings(
            time_step=125.0, normal_penalty=200e9 * stress, shear_penalty=200e9 * stress, max_displacement_ratio=1.0
        ),
        growth=GrowthSettings(increment=2e-3 * length, min_increment=2e-4 * length, max_passes=2),
        run=RunSettings(end_time=260.0),
        load_edge="load:top",
        gauge=((home, tuple(at([0.0, -H]))), (home, tuple(at([0.0, H])))),
    )


@pytest.fixture(scope="module", params=[False, True], ids=["bare", "platens"])
def reference(request):
    seen = list(cycles(specimen(request.param)))
    assert any(cycle.tips["grown"].any() for cycle in seen if len(cycle.tips))
    return request.param, seen


def assert_same(reference, seen, tolerance, turn=None, shift=(0.0, 0.0), length=1.0, stress=1.0, tips=slice(None)):
    turn = np.eye(2) if turn is None else turn
    assert len(seen) == len(reference)
    for a, b in zip(reference[1:], seen[1:], strict=True):
        assert [e.kind for e in a.events] == [e.kind for e in b.events]
        assert b.load / stress == pytest.approx(a.load, rel=1e-12)
        assert b.strain == pytest.approx(a.strain, rel=tolerance)
        points = (b.tips["point"] - np.asarray(shift)) @ turn / length
        assert np.abs(points[tips] - a.tips["point"]).max() < tolerance * CRACK
        scale = stress * np.sqrt(length)
        largest = np.hypot(a.tips["k_i"], a.tips["k_ii"]).max()
        handed = np.sign(np.linalg.det(turn))
        assert np.abs(b.tips["k_i"][tips] / scale - a.tips["k_i"]).max() < tolerance * largest
        assert np.abs(handed * b.tips["k_ii"][tips] / scale - a.tips["k_ii"]).max() < tolerance * largest


@pytest.mark.parametrize(("shift", "tolerance"), [((1e3, -7e2), 1e-5), ((1e6, 3e5), 1e-2)])
def test_translation(reference, shift, tolerance):
    """Coordinates at distance L from the origin have a spacing of 1e-16 L, and block strains are differences of
    coordinates: at a strain of 3e-4 of 0.06 m that is 6e-9 at 1 km and 6e-6 at 1000 km; growing tips under compression
    multiply it by some 30 (found: K to 7e-7 and 3e-4, tips to 1e-7 and 3e-5)."""
    platens, seen = reference
    assert_same(seen, list(cycles(specimen(platens, shift=shift))), tolerance, shift=shift)


def test_quarter_turn(reference):
    """Coordinates are exchanged exactly; only the order of sums differs."""
    platens, seen = reference
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    assert_same(seen, list(cycles(specimen(platens, turn=turn))), 1e-9, turn=turn)


def test_oblique_turn():
    """Round-off of the turned coordinates, 1e-16 of 0.06 m on displacements of 1e-5 m, multiplied by growth."""
    c, s = np.cos(np.radians(37)), np.sin(np.radians(37))
    turn = np.array([[c, -s], [s, c]])
    assert_same(list(cycles(specimen(False))), list(cycles(specimen(False, turn=turn))), 1e-8, turn=turn)


def test_mirror_image(reference):
    """Left and right exchanged: K_I stands, K_II changes its sign."""
    platens, seen = reference
    turn = np.diag([-1.0, 1.0])
    assert_same(seen, list(cycles(specimen(platens, turn=turn))), 1e-8, turn=turn)


@pytest.mark.parametrize("length", [1e-3, 1e3])
def test_size(reference, length):
    """K goes with the root of the length, so with K_Ic scaled alike all else stands."""
    platens, seen = reference
    assert_same(seen, list(cycles(specimen(platens, length=length))), 1e-8, length=length)


@pytest.mark.parametrize("stress", [1e-6, 1e3])
def test_units_of_stress(reference, stress):
    platens, seen = reference
    assert_same(seen, list(cycles(specimen(platens, stress=stress))), 1e-8, stress=stress)


def test_numbering_of_blocks_and_cracks():
    """Blocks in another order, cracks in reverse order and direction: tips come in reverse, too."""
    seen = list(cycles(specimen(True)))
    other = list(cycles(specimen(True, order=(2, 0, 1), flip_cracks=True)))
    assert_same(seen, other, 1e-8, tips=slice(None, None, -1))
