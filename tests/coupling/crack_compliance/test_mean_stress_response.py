"""Blocks whose cracks answer to their mean stress, against the compliance that the handbook's K gives, at rest and in motion."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from geomech import ddm
from geomech.coupling import Coupling
from geomech.coupling.crack_compliance.mean_stress_response import SOFT, SOFTEST, ByMeanStress
from geomech.coupling.load_pass import _softest
from geomech.model import (
    CONTACT,
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from geomech.reference.cracks.plates import edge_crack_strip

ROCK = Material("rock", 10e9, 0.2, density=2500.0, k_ic=1e12)
HEIGHT = 2.0
BAR = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, HEIGHT], [0.0, HEIGHT]])


def edge_crack(ratio: float, aperture: float, block: int) -> Cracks:
    line = np.array([[0.0, HEIGHT / 2], [ratio, HEIGHT / 2]])
    return Cracks.from_polylines([line], block=block, aperture=aperture, surface=[(True, False)])


def softness_by_k(ratio: float) -> float:
    """E' S_yy of the bar: its stretch across the crack is 2 σ/E' ∫ F² π a da / W (Irwin 1957), F of Tada, Paris &
    Irwin's strip."""
    return 2 * quad(lambda a: edge_crack_strip(a) ** 2 * math.pi * a, 0, ratio)[0] / HEIGHT


def falls_on_its_base(ratio: float, aperture: float, steps: int, periods: float) -> Problem:
    """The bar comes under its weight at once on a fixed base without friction, ``steps`` to the period of its
    bounce."""
    base = np.array([[-1.0, -1.0], [2.0, -1.0], [2.0, 0.0], [-1.0, 0.0]])
    step = period(ratio) / steps
    return Problem(
        title="a bar on its base",
        blocks=Blocks.from_polygons([base, BAR], fixed=[True, False]),
        cracks=edge_crack(ratio, aperture, 1),
        materials=(ROCK,),
        joints=(JointLaw("joint"),),
        loads=Loads(gravity=History.constant([0.0, -9.81])),
        dda=DdaSettings(time_step=step, dynamic_factor=1.0, newmark=(0.25, 0.5), damping=0.0),
        ddm=DdmSettings(),
        growth=GrowthSettings(increment=0.05),
        run=RunSettings(end_time=periods * period(ratio), stop_at=()),
    )


def period(ratio: float) -> float:
    """s, of an even strain ε on a fixed base, ρ H² ε̈ / 3 = −E' ε / (1 + E' S)."""
    return 2 * math.pi * HEIGHT * math.sqrt(ROCK.density / 3 / ROCK.plane_modulus * (1 + softness_by_k(ratio)))


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("ratio", [0.5, 0.75])
def test_a_cracked_block_bounces_as_its_ligament_s_compliance_has_it(ratio):
    """An edge crack through a half or three quarters, 2 or 16 times as soft as the bar: mean and largest strain and the
    period of the bounce are those of the compliance by K; passes agree at once, and the energy of the motion stays."""
    soft, given = softness_by_k(ratio), falls_on_its_base(ratio, np.inf, 100, 1.6)
    run = Coupling(given)
    seen = [cycle for cycle in run.cycles() if cycle.number]
    assert 1 in run.now.by_mean_stress and soft < SOFTEST and (soft > SOFT) == (ratio > 0.5)
    height = np.array([cycle.state.vertices[6:, 1].mean() for cycle in seen]) - HEIGHT
    time = np.array([cycle.state.time for cycle in seen]) / period(ratio)
    still = 9.81 * ROCK.density * HEIGHT**2 / 2 * (1 + soft) / ROCK.plane_modulus
    # F is known to 0.5 %, the bar is twice as high as wide, the contacts give a little.
    assert -height.min() == pytest.approx(2 * still, rel=0.02)
    assert abs(height.max()) < 0.02 * still
    lows = time[1:-1][(height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:])]
    assert lows[:2] == pytest.approx([0.5, 1.5], abs=0.025)
    statistics = [cycle.statistics for cycle in seen]
    assert max(told["compliance_mismatch"] for told in statistics) < 1e-6
    assert max(told["compliance_passes"] for told in statistics[1:]) <= 2
    turned = max(abs(told["gravity_work"]) for told in statistics)
    assert max(abs(told["energy_residual"]) for told in statistics) < 1e-4 * turned


def test_at_rest_forces_and_strain_of_a_soft_block_agree_without_taking_it_to_hang():
    """The bar of the bounce in static steps: it stands on its base as the compliance by K has it, in a few passes, and
    its cracks answer to the forces that act."""
    ratio = 0.75
    given = falls_on_its_base(ratio, np.inf, 1, 3.0)
    run = Coupling(replace(given, dda=DdaSettings(time_step=given.dda.time_step, dynamic_factor=0.0)))
    *_, last = run.cycles()
    assert not run.now.by_mean_stress.solutions and 1 not in run.now.by_mean_stress
    still = 9.81 * ROCK.density * HEIGHT**2 / 2 * (1 + softness_by_k(ratio)) / ROCK.plane_modulus
    # As for the bounce: F is known to 0.5 %, the bar is twice as high as wide, the contacts give a little.
    assert HEIGHT - last.state.vertices[6:, 1].mean() == pytest.approx(still, rel=0.02)
    assert last.statistics["compliance_mismatch"] < 1e-6
    assert last.statistics["compliance_passes"] <= 4


@pytest.mark.parametrize("ratio", [0.5, 0.75])
def test_a_run_from_equilibrium_begins_with_its_cracks_at_rest(ratio):
    """The bar of the bounce from static equilibrium: it stands where the softness by K has it and stays there. (Cracks that
    opened in the first step alone let it bounce by half of what they soften it.)"""
    given = falls_on_its_base(ratio, np.inf, 100, 0.5)
    seen = list(Coupling(replace(given, dda=replace(given.dda, equilibrium="start"))).cycles())
    height = np.array([cycle.state.vertices[6:, 1].mean() for cycle in seen]) - HEIGHT
    still = 9.81 * ROCK.density * HEIGHT**2 / 2 * (1 + softness_by_k(ratio)) / ROCK.plane_modulus
    assert -height[0] == pytest.approx(still, rel=0.02)
    assert np.abs(height - height[0]).max() < 1e-4 * still
    last = seen[-1].statistics
    at_rest = last["crack_elastic"] + last["elastic_energy"]
    assert max(abs(last[name]) for name in ("kinetic_energy", "crack_residual", "parting_energy")) < 1e-6 * at_rest


def test_faces_that_close_under_the_mean_stress_carry_it():
    """A closed crack: in compression the hanging bar is as stiff as a whole one."""
    seen = [cycle for cycle in Coupling(falls_on_its_base(0.75, 0.0, 400, 0.1)).cycles() if cycle.number]
    strain = np.abs(np.array([cycle.state.crack_strain[1] for cycle in seen])).max()
    elastic = np.abs(np.array([cycle.state.stress[1] for cycle in seen])).max() / ROCK.plane_modulus
    assert max(cycle.statistics["compliance_mismatch"] for cycle in seen) < 1e-4
    assert strain < 1e-3 * elastic


@pytest.mark.parametrize(("ratio", "hangs"), [(0.3, False), (0.75, True)])
def test_softness_is_that_by_k_and_only_what_is_touched_hangs(ratio, hangs):
    body = ddm.Body([BAR], edge_crack(ratio, np.inf, 0), ROCK)
    elastic = ROCK.compliance()[None]
    hanging = ByMeanStress()
    touch = np.zeros(1, CONTACT)
    touch["block"], touch["other"] = 0, 5
    hanging.find({0: body}, elastic, touch)
    assert 0 not in hanging
    touch["normal_force"] = 1.0
    hanging.find({0: body}, elastic, touch)
    assert (0 in hanging) == hangs
    # In one direction, σ_yy but for a little of the others: no less than that of σ_yy, and not much more.
    assert 1.0 <= hanging._soft(0, body, elastic[0]) / softness_by_k(ratio) < 1.12


def test_what_hangs_by_less_than_a_quarter_is_taken_for_no_softer():
    """… in the direction in which it is, and the answer in tension is that of what is left of the stress."""
    ratio = 0.95
    body, elastic = ddm.Body([BAR], edge_crack(ratio, np.inf, 0), ROCK), ROCK.compliance()
    pull = np.array([0.0, 1e6, 0.0])
    alone = body.solve(ddm.BodyLoad(remote_stress=pull))
    assert alone.crack_strain[1] * ROCK.plane_modulus / 1e6 == pytest.approx(softness_by_k(ratio), rel=0.02)
    known = ByMeanStress()
    limit, answer = known.limit(0, body, elastic), known.answer(0, body, pull, 0.0, elastic)
    whole, felt = body.compliance(), limit.T @ body.compliance() @ limit
    np.testing.assert_allclose(limit.T @ answer.crack_strain, felt @ pull, rtol=1e-3, atol=1e-3 * felt.max() * 1e6)
    had, has = (np.sort(np.linalg.eigvals(np.linalg.solve(elastic, of)).real) for of in (whole, felt))
    np.testing.assert_allclose(has, np.minimum(had, SOFTEST), rtol=1e-9, atol=1e-9 * SOFTEST)
    assert had[-1] > SOFTEST > 3 * had[-2]


def test_a_block_that_is_stiff_enough_has_no_limit():
    body = ddm.Body([BAR], edge_crack(0.75, np.inf, 0), ROCK)
    np.testing.assert_array_equal(ByMeanStress().limit(0, body, ROCK.compliance()), np.eye(3))


def test_closed_faces_do_not_count_in_the_limit():
    """A closed crack nearly through the bar beside an open one through a half of it. In compression the bar is as soft as
    the open one makes it, and the other limits nothing, until tension opens it."""
    beside = [np.array([[0.0, y], [ratio, y]]) for y, ratio in ((0.5, 0.5), (1.5, 0.95))]
    cracks = Cracks.from_polylines(beside, block=0, aperture=[1.0, 0.0], surface=[(True, False)] * 2)
    alone = Cracks.from_polylines(beside[:1], block=0, aperture=1.0, surface=[(True, False)])
    body, elastic = ddm.Body([BAR], cracks, ROCK), ROCK.compliance()
    known, press = ByMeanStress(), np.array([0.0, -1e6, 0.0])
    assert known._soft(0, body, elastic) > SOFTEST
    pressed = known.answer(0, body, press, 0.0, elastic)
    np.testing.assert_array_equal(known.limit(0, body, elastic), np.eye(3))
    softened = ByMeanStress().answer(0, ddm.Body([BAR], alone, ROCK), press, 0.0, elastic).crack_strain[1]
    assert pressed.crack_strain[1] == pytest.approx(softened, rel=1e-2)
    known.answer(0, body, -press, 0.0, elastic)
    limit = known.limit(0, body, elastic)
    assert np.linalg.norm(limit - np.eye(3)) > 0.1 and known.limits(0)


def test_growth_never_stiffens_a_limited_block():
    """An edge crack on its way through: in no direction is the bar stiffer than before, and in those beside the one
    with the limit it is as soft as it is."""
    elastic, felt = ROCK.compliance(), [np.zeros((3, 3))]
    for ratio in (0.7, 0.8, 0.9, 0.97):
        body = ddm.Body([BAR], edge_crack(ratio, np.inf, 0), ROCK)
        limit = ByMeanStress().limit(0, body, elastic)
        felt.append(limit.T @ body.compliance() @ limit)
        more = np.linalg.eigvals(np.linalg.solve(elastic, felt[-1] - felt[-2])).real
        assert more.min() > -1e-9 * SOFTEST and more.max() > 0.1


def test_of_blocks_that_chase_their_cracks_the_soft_ones_give_way():
    """What one drags along gives way only where no soft one chases; where more of them do, all that are soft: which
    neighbours they drag along, rounding decides."""
    bodies = {
        b: ddm.Body([BAR], edge_crack(ratio, np.inf, 0), ROCK)
        for b, ratio in ((3, 0.2), (5, 0.75), (6, 0.75), (7, 0.8), (8, 0.3))
    }
    compliance = np.tile(ROCK.compliance(), (9, 1, 1))
    now = SimpleNamespace(bodies=bodies, by_mean_stress=ByMeanStress(), elastic=compliance.__getitem__)
    assert _softest(now, {3, 5, 8}) == {5} and _softest(now, {5}) == {5}
    assert _softest(now, {3, 5, 6}) == {5, 6, 7}
    assert _softest(now, {3, 8}) == {3, 8} and _softest(now, set()) == set()
