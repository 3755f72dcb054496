"""Bonds that fail by faces: Navier's extreme fibre in tension, Coulomb's strength of the whole face in shear."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.model import (
    OPEN,
    STICK,
    Blocks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    State,
)

TENSION, COHESION, FRICTION = 2e6, 1e6, np.radians(30)
FACE = 2.0
GLUE = JointLaw("glue", FRICTION, COHESION, TENSION)


def two_blocks(law: JointLaw = GLUE, splits: int = 1, turn: float = 0.0, back: bool = False) -> dda.BlockSystem:
    """A block of 2 m × 1 m on a fixed one, the face between them cut into ``splits`` by flat vertices; turned by
    ``turn`` (rad) and, ``back``, numbered the other way."""
    x = np.linspace(0.0, FACE, splits + 1)
    lower = np.concatenate([[[-1.0, -1.0], [3.0, -1.0], [3.0, 0.0]], [[s, 0.0] for s in x[::-1]], [[-1.0, 0.0]]])
    upper = np.concatenate([[[s, 0.0] for s in x], [[FACE, 1.0], [0.0, 1.0]]])
    c, s = np.cos(turn), np.sin(turn)
    polygons = [p @ np.array([[c, s], [-s, c]]) for p in (lower, upper)]
    fixed = [True, False]
    blocks = Blocks.from_polygons(polygons[::-1] if back else polygons, fixed=fixed[::-1] if back else fixed)
    return dda.BlockSystem(
        blocks, [Material("rock", 1e12, 0.0, density=2600.0)], [law], settings=DdaSettings(max_displacement_ratio=0.5)
    )


def pushed(system: dda.BlockSystem, thrust: float, eccentricity: float, shear: float = 0.0, state: State | None = None):
    """The step under a force on the upper block, ``thrust`` N onto the face, ``shear`` N along it, through the point of
    the face at ``eccentricity`` m from its middle."""
    lower = int(np.flatnonzero(system.blocks.fixed)[0])
    edge = system.blocks.vertices[system.blocks.vertex_start[lower] :][:2]
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    # Beyond the face by a lever: a block's motion is affine, so that of a point further out is extrapolated from two.
    lever = max(1.0, abs(eccentricity) / (0.5 * FACE))
    middle, at = 0.5 * FACE * along, (0.5 * FACE + eccentricity / lever) * along
    force = shear * along - thrust * np.array([-along[1], along[0]])
    loads = Loads(
        point_loads=tuple(
            PointLoad(1 - lower, tuple(point), History.constant(share * force))
            for point, share in ((middle, 1.0 - lever), (at, lever))
        )
    )
    # A step in which the block flies off is cut to where inertia, 2 m/dt², bears 1e-5 of what stiff rock and its
    # springs do.
    return system.step(State.at_rest(system.blocks) if state is None else state, loads, 3e-2)


def limit(holds, low: float, high: float, rounds: int = 16) -> float:
    assert holds(low) and not holds(high)
    for _ in range(rounds):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


@pytest.mark.parametrize(
    ("splits", "turn", "back"), [(1, 0.0, False), (1, 0.6, True), (1, 3.0, False), (3, 1.7, False)]
)
def test_a_pulled_face_fails_at_its_extreme_fibre(verified, splits, turn, back):
    """P/ℓ + 6 P e/ℓ² = σ_t (Navier), whichever way the face looks, by whichever of its ends."""
    errors = []
    for eccentricity in (0.0, 0.2, -0.7, 3.0, -50.0):
        expected = TENSION * FACE / (1 + 6 * abs(eccentricity) / FACE)

        def holds(pull, eccentricity=eccentricity):
            rows = pushed(two_blocks(splits=splits, turn=turn, back=back), -pull, eccentricity).contacts
            rows = rows[rows["length"] > 0]
            whole = rows["bonded"] == 1
            assert whole.all() or not whole.any()
            return bool(whole.all())

        errors.append(limit(holds, 0.5 * expected, 1.5 * expected) / expected - 1)
    print(f"splits {splits}, turned by {turn}: strength off by", " ".join(f"{e:.1e}" for e in errors))
    verified("pulled face, five eccentricities, four ways to cut and turn it: strength", np.abs(errors).max(), "Navier")
    # What inertia bears.
    assert np.abs(errors).max() < 1e-4


@pytest.mark.parametrize("law", [GLUE, JointLaw("no tension", FRICTION, COHESION)], ids=["glue", "no tension"])
def test_a_sheared_face_holds_as_much_wherever_it_is_pressed(verified, law):
    """c ℓ + N tan φ, the resultant N anywhere within the kern."""
    thrust = 3e6
    expected = COHESION * FACE + thrust * np.tan(FRICTION)
    errors = []
    for eccentricity in (0.0, FACE / 12, -FACE / 6.1, FACE / 6.1):

        def holds(shear, eccentricity=eccentricity):
            rows = pushed(two_blocks(law), thrust, eccentricity, shear).contacts
            return bool(rows["bonded"].all())

        errors.append(limit(holds, 0.5 * expected, 1.5 * expected) / expected - 1)
    print("shear strength off by", " ".join(f"{e:.1e}" for e in errors))
    verified(
        "sheared face, four eccentricities, with and without tensile strength", np.abs(errors).max(), "c ℓ + N tan φ"
    )
    assert np.abs(errors).max() < 2e-5


def test_a_cantilever_of_blocks_breaks_at_its_root_as_a_beam(verified):
    """σ = 3 ρ g L²/D, the bending stress at the root under the beam's own weight."""
    blocks = Blocks.from_polygons(
        [np.array([[-1.0, -1], [0, -1], [0, 2], [-1, 2]])]
        + [np.array([[k, 0.0], [k + 1, 0], [k + 1, 1], [k, 1]]) for k in range(5)],
        fixed=[True] + [False] * 5,
    )
    weight = Loads(gravity=History.constant([0.0, -9.81]))
    expected = 3 * 2600 * 9.81 * 25.0

    def holds(strength):
        law = JointLaw("glue", 0.5, 1e8, strength)
        system = dda.BlockSystem(
            blocks,
            [Material("rock", 1e12, 0.25, density=2600.0)],
            [law],
            settings=DdaSettings(max_displacement_ratio=0.5),
        )
        rows = system.step(State.at_rest(blocks), weight, 0.1).contacts
        lost = rows[(rows["bonded"] == 0) & (rows["length"] > 0)]
        assert len(lost) == 0 or set(lost["other"]) | set(lost["block"]) <= {0, 1}
        return not len(lost)

    found = 1.0 / limit(lambda part: holds(expected / part), 0.7, 1.3, 14)
    verified("cantilever of glued blocks: stress at which its root breaks", found - 1, "3 ρ g L² / D")
    print(f"root breaks at {found:.5f} of the beam's stress")
    # Inertia of a step of 0.1 s bears 2/(ω dt)² = 3e-4 of the load, ω = 800/s.
    assert found == pytest.approx(1.0, rel=1e-3)


def test_a_face_pressed_off_its_kern_cracks_from_the_edge_and_holds_no_pull_then():
    system = two_blocks()
    thrust = 10e6
    # 6 e/ℓ − 1 times N/ℓ = 5 MPa is tension at the edge: 1 MPa at 0.4 m, 4 MPa at 0.6 m, which cracks.
    assert set(pushed(system, thrust, 0.4).contacts["bonded"]) == {1}
    cracked = pushed(system, thrust, 0.6)
    assert set(cracked.contacts["bonded"]) == {3} and set(cracked.contacts["state"]) == {STICK}
    # Cohesion is left, …
    strength = COHESION * FACE + thrust * np.tan(FRICTION)
    assert set(pushed(system, thrust, 0.6, 0.99 * strength, cracked.state).contacts["bonded"]) == {3}
    assert set(pushed(system, thrust, 0.6, 1.01 * strength, cracked.state).contacts["bonded"]) == {0}
    # … and no tensile strength.
    held, parted = (pushed(system, -0.1 * TENSION, 0.0, state=state).contacts for state in (None, cracked.state))
    assert set(held["bonded"]) == {1}
    assert set(parted["bonded"]) == {0} and set(parted["state"]) == {OPEN}


def test_softening_keeps_the_strength_of_the_whole_face():
    """Cohesion that slip wears is there when the face begins to slide, off its middle as well, and is less after."""
    law = JointLaw("softens", FRICTION, COHESION, residual_cohesion=0.5 * COHESION, softening_slip=0.01)
    thrust = 3e6
    expected = COHESION * FACE + thrust * np.tan(FRICTION)
    for eccentricity in (0.0, 0.3):
        rows = pushed(two_blocks(law), thrust, eccentricity, 0.999 * expected).contacts
        assert set(rows["bonded"]) == {1} and set(rows["state"]) == {STICK}


def test_blocks_beside_one_another_on_one_line_are_faces_of_their_own():
    polygons = [np.array([[-1.0, -1], [5, -1], [5, 0], [-1, 0]])]
    polygons += [np.array([[x, 0.0], [x + 1, 0], [x + 1, 1], [x, 1]]) for x in (0.0, 1.0, 2.5)]
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * 3)
    system = dda.BlockSystem(blocks, [Material("rock", 10e9, 0.0, density=2600.0)], [GLUE])
    found = system.finder.find(State.at_rest(blocks), blocks.vertices, 0.01, lumped=True)
    faces = found.faces
    assert len(faces.length) == 4 and faces.length == pytest.approx(1.0)
    for k in range(4):
        members = faces.rows[faces.start[k] : faces.start[k + 1]]
        assert len({(min(found.block[c], found.other[c]), max(found.block[c], found.other[c])) for c in members}) == 1
    assert np.sort(np.abs(faces.arm)) == pytest.approx(0.5)


def test_a_slab_on_stiff_springs_keeps_all_of_its_cohesion():
    # On springs forty times as stiff as the rock the slab's strain loads the ends of its base unevenly.
    blocks = Blocks.from_polygons(
        [np.array([[-3.0, -1], [8, -1], [8, 0], [-3, 0]]), np.array([[0.0, 0], [4, 0], [4, 2], [0, 2]])],
        fixed=[True, False], edge_names=[[[""] * 4], [["", "", "top", ""]]],
    )  # fmt: skip
    law = JointLaw("plane", FRICTION, COHESION)
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.25, density=2600.0)], [law], settings=DdaSettings(max_displacement_ratio=0.5)
    )
    expected = COHESION * 4 + 2e6 * 4 * np.tan(FRICTION)

    def holds(drag):
        # Half a metre above the base, so that the resultant is at an eighth of the face's length from its middle.
        loads = Loads(
            edge_tractions=(EdgeTraction("top", History.constant([0.0, -2e6])),),
            point_loads=(PointLoad(1, (0.0, 0.5), History.constant([drag, 0.0])),),
        )
        rows = system.step(State.at_rest(blocks), loads, 3e-2).contacts
        return bool(rows["bonded"].all())

    found = limit(holds, 0.5 * expected, 1.2 * expected, 16)
    print(f"slab holds {found / expected:.5f}")
    assert found == pytest.approx(expected, rel=1e-3)
