"""Where slanted cracks start, as measured, and how wings of a closed crack grow, as Horii & Nemat-Nasser have it."""

import math

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm.fracture.criteria import CRITERIA
from geomech.model import Cracks, GrowthSettings, JointLaw, Material
from geomech.reference.specimens import slanted_crack as plates
from geomech.reference.specimens.single_flaw import wing_horii_nemat_nasser

PLEXIGLAS = Material("plexiglas", 3e9, plates.POISSONS_RATIO, k_ic=1e6)
ROCK = Material("rock", 17e9, 0.21, k_ic=1e6)
HALF = 10e-3
PRESSED = ddm.BodyLoad(remote_stress=[0, -1e6, 0])


def turns(beta):
    """Criterion → the turn at which the crack of a measured sheet starts, degrees."""
    w, h = plates.HALF_WIDTH, plates.HALF_HEIGHT
    sheet = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    end = plates.HALF_LENGTH * np.array([math.sin(math.radians(beta)), math.cos(math.radians(beta))])
    load = ddm.BodyLoad(sides={0: (0.0, -1e6), 2: (0.0, 1e6)})
    tips = ddm.Body([sheet], Cracks.from_polylines([[-end, end]], aperture=math.inf), PLEXIGLAS).solve(load).tips
    return {
        name: float(np.degrees(np.abs(rule(tips["k_i"], tips["k_ii"], PLEXIGLAS)[0])).mean())
        for name, rule in CRITERIA.items()
        if name != "f"
    }


def test_slanted_cracks_start_where_they_were_seen_to():
    """Erdogan & Sih (1963), six means of measured angles. The largest hoop stress and the local minimum of S come
    within 1.3° of them on average, the energy release rate, which turns farther, within 2.2°: less than single cracks
    scatter. The sheet's width changes the angles by less than 0.8°."""
    found = {beta: turns(beta) for beta in plates.MEASURED_TURN}
    names = list(next(iter(found.values())))
    print("\n  β   measured   plane (mts)  " + "".join(f"{name:>8}" for name in names))
    for beta, measured in plates.MEASURED_TURN.items():
        exact = plates.largest_hoop_stress(beta)
        print(
            f"{beta:4.0f}°   {measured:6.1f}°   {exact:6.1f}°     " + "".join(f"{found[beta][n]:7.1f}°" for n in names)
        )
        assert found[beta]["mts"] == pytest.approx(exact, abs=0.8)
    off = {n: np.mean([abs(found[b][n] - m) for b, m in plates.MEASURED_TURN.items()]) for n in names}
    print("mean difference, degrees:", off)
    assert off["mts"] < 1.4 and off["s"] < 1.3 and max(off.values()) < 2.3


@pytest.mark.parametrize(("degrees", "friction"), [(45, 0.0), (45, 0.3), (54, 0.3), (60, 0.6)])
def test_straight_wings_of_a_sliding_crack(degrees, friction):
    """Horii & Nemat-Nasser (1986): K_I of wings along the load against l/c. Their formula (an interpolation between
    short and long wings) is 1 to 10 % above, for all lengths and with friction as without."""
    end = HALF * np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    law = [JointLaw("flaw", friction_angle=math.atan(friction))]
    for ratio in (0.1, 0.3, 1.0, 2.0, 4.0):
        wing = np.array([0.0, ratio * HALF])
        cracks = Cracks.from_polylines([np.array([-end - wing, -end, end, end + wing])])
        k = ddm.Body([], cracks, ROCK, face_laws=law).solve(PRESSED).tips["k_i"]
        published = 1e6 * float(wing_horii_nemat_nasser(ratio * HALF, HALF, degrees, friction))
        print(f"{degrees}°, μ = {friction}: l/c = {ratio}: {k[0] / published:.3f} of the formula")
        np.testing.assert_allclose(k, k[0], rtol=1e-6)
        assert 0.89 < k[0] / published < 1.0


def test_wings_of_a_closed_crack_with_friction_grow_into_the_load():
    """Growth of a closed crack at 54° with μ = 0.3 under the load that just drives it. Wings leave it turned by 70.5°
    (pure mode II) and bend into the load's direction; every increment takes more load. Their K_I begins as the
    formula for straight wings has it (1.0 at l/c = 0.3) and falls to 0.6 of it at l/c = 2: it is as long as they, but
    the load presses on the slanted beginning, of which straight wings along the load have none."""
    end = HALF * np.array([math.cos(math.radians(54)), math.sin(math.radians(54))])
    law = [JointLaw("flaw", friction_angle=math.atan(0.3))]
    cracks, growth = Cracks.from_polylines([[-end, end]]), GrowthSettings(increment=1e-3, min_increment=1e-3)
    steps = list(ddm.propagate([], cracks, ROCK, PRESSED, growth, control="toughness", max_steps=21, face_laws=law))
    loads, ratios, directions = [], [], []
    for step in steps[1:]:
        length = 0.5 * float(step.cracks.lengths.sum()) - HALF
        formula = 1e6 * float(wing_horii_nemat_nasser(length, HALF, 54, 0.3))
        loads.append(step.load_factor)
        ratios.append(ROCK.k_ic / (step.load_factor * formula))
        way = step.tips["direction"][1]
        directions.append(math.degrees(math.atan2(way[1], way[0])))
        print(
            f"l/c = {length / HALF:.1f}: {step.load_factor:.1f} MPa, {ratios[-1]:.3f} of the formula, "
            f"{directions[-1]:.1f}°"
        )
    assert steps[0].tips["angle"] == pytest.approx(math.acos(1 / 3), abs=0.02)
    assert (np.diff(loads) > 0).all()
    # The path is smooth and so are its chords, though κ of `ddm.growth.path_correction` rises to 7.
    assert (np.diff(directions) < 0).all() and directions[-1] == pytest.approx(90, abs=3)
    assert ratios[2] == pytest.approx(1.0, abs=0.06) and ratios[-1] == pytest.approx(0.6, abs=0.03)
