"""Cracked blocks whose order is found as the run goes: who is raised, against fixed orders; what a raised block keeps."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_bent_blocks import GLUE, cantilever
from test_cracks_in_blocks_of_higher_order import SLANTED, of_order, specimen

from geomech.bench.cost.block_scenes import cracked_wall
from geomech.coupling import Coupling, cycles
from geomech.coupling.order_raising import take_orders
from geomech.model import AUTO_ORDER, DdaSettings, Motion, Problem
from geomech.output.checkpoints import checkpoint_file
from geomech.scene import load_scene

BEAM = Path(__file__).parents[2] / "geometry" / "notched_beam.toml"


def auto(problem: Problem, **settings) -> Problem:
    return replace(of_order(problem, AUTO_ORDER), dda=replace(problem.dda, **settings))


def at_rest(ratio: float, order: int, target: float = 0.01):
    """Last cycle of a static cantilever, cracked through ``ratio`` of its depth, under its weight."""
    problem = of_order(cantilever(ratio, 1.0, 1.0, 1e14), order)
    *_, last = cycles(replace(problem, dda=DdaSettings(time_step=1.0, order_target=target)))
    return last


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize(("ratio", "target", "least"), [(0.2, 0.1, 3), (0.2, 0.01, 5), (0.5, 0.1, 4), (0.5, 0.01, 6)])
def test_a_cracked_cantilever_at_rest_finds_its_order(ratio, target, least):
    """Deflection within twice the target of that of order 8, and what a beam has that has this order from the first, as far as
    passes agree; energies add up. A crack through half of the depth takes a higher order than one through a fifth."""
    found, best = at_rest(ratio, AUTO_ORDER, target), at_rest(ratio, 8)
    order = int(found.state.order[1])
    assert order >= least
    assert found.monitors["tip"][1] == pytest.approx(best.monitors["tip"][1], rel=2 * target)
    given = at_rest(ratio, order)
    assert found.monitors["tip"][1] == pytest.approx(given.monitors["tip"][1], rel=1e-6)
    assert found.tips["k_i"] == pytest.approx(given.tips["k_i"], rel=1e-6)
    told = found.statistics
    assert told["crack_work"] == pytest.approx(told["crack_elastic"], rel=1e-5)
    assert abs(told["budget_residual"]) < 1e-7


def test_a_swinging_cracked_cantilever_finds_its_order():
    """Raised in the first step; tip and K as of order 8 to 1 and 3 %, energies add up to 1e-4 of the work of the weight."""
    seen = [
        list(cycles(p))
        for p in (auto(cantilever(0.5, 4e-5, 4e-3, GLUE)), of_order(cantilever(0.5, 4e-5, 4e-3, GLUE), 8))
    ]
    assert seen[0][1].state.order[1] >= 5
    tip, k = ([part(own) for own in seen] for part in (lambda own: own[-1].monitors["tip"][1], _largest_k))
    assert tip[0] == pytest.approx(tip[1], rel=0.01)
    assert k[0] == pytest.approx(k[1], rel=0.03)
    told = [cycle.statistics for cycle in seen[0] if cycle.number]
    work = max(abs(one["gravity_work"]) for one in told)
    assert max(abs(one["crack_residual"]) for one in told) < 1e-4 * work
    assert max(abs(one["budget_residual"]) for one in told) < 1e-4


def _largest_k(seen) -> float:
    return max(float(cycle.tips["k_i"].max()) for cycle in seen if len(cycle.tips))


@pytest.mark.parametrize("begun", [1, 2, 4])
def test_a_block_that_is_raised_in_motion_goes_on_where_it_was(begun):
    """Outline, momentum, kinetic and elastic energy, stress at the tip and in the corners, and the energy around the crack, of
    a swinging cantilever before and after it is raised: the same to round-off (of the crack, to what passes agree to). The
    strain of the crack under the block's stress is that of the state, so that no force appears."""
    problem = of_order(cantilever(0.5, 4e-5, 4e-3, GLUE), AUTO_ORDER)
    coupling = Coupling(problem)
    now = coupling.now
    now.system.order_choice.target = 1e9
    now.state = replace(now.state, order=np.array([1, begun]))
    if begun > 1:
        take_orders(now, np.array([1, begun]), now.response, now.state)

    class Between(Exception):
        """Twelve passes are done."""

    passes = iter(range(12))

    def between() -> None:
        if next(passes, None) is None:
            raise Between

    coupling.between = between
    with pytest.raises(Between):
        list(coupling.cycles())
    points = np.array([[0.52, 0.5], [0.0, 0.0], [2.0, 1.0], [1.0, 0.3]])

    def told() -> dict:
        state, field = now.state, now.by_mean_stress.fields.get(1)
        blocks, moved = now.system.deflected, Motion.of(now.blocks, now.state.vertices).current(1, points)
        stress, elastic, kinetic = np.tile(state.stress[1], (4, 1)), 0.0, 0.0
        if field is not None:
            units = field.units(points)
            stress = units @ field.stress_of(state)
            beyond = blocks.elastic_part(state)
            elastic = blocks.elastic_energy(beyond)
            own = blocks.basis.of_block(1)
            moved = moved + blocks.basis.displacement(points, 1)[..., : own.stop - own.start] @ state.deflection[own, 0]
            density = np.where(now.system.fixed, 0.0, now.system.density)
            kinetic = blocks.kinetic(state.deflection[:, 1], state.velocity[:, 3:], state.rotation, density)
        return {"moved": moved, "stress": stress, "elastic": elastic, "kinetic": kinetic, "velocity": state.velocity}

    before, stored = told(), now.crack_energy.stored
    take_orders(now, np.array([1, begun + 2]), now.response)
    after = told()
    for name, value in before.items():
        size = np.abs(value).max() if np.any(value) else 1.0
        np.testing.assert_allclose(after[name], value, rtol=0, atol=1e-9 * size, err_msg=name)
    field, response = now.by_mean_stress.fields[1], now.response
    sigma = field.stress_of(now.state)
    found = response.offset[1, : field.width] + response.compliance[1, : field.width, : field.width] @ sigma
    assumed = field.crack_strain_of(now.state)
    assert np.abs(found - assumed).max() < 1e-3 * np.abs(assumed).max()
    # (The energy around the crack is that of its jumps under the stress of the block.)
    assert now.by_mean_stress.solutions[1].crack_energy == pytest.approx(stored, rel=2e-4)


def test_a_run_that_is_stored_while_blocks_are_raised_goes_on_to_the_bit(tmp_path):
    """A beam that breaks in motion, stored between two passes after it has been raised, and between growth."""
    problem = auto(cantilever(0.3, 1e-4, 2e-3, GLUE, 2e5, 0.4))

    def told(cycle) -> bytes:
        state = cycle.state
        parts = [state.vertices, state.velocity, state.stress, state.order, cycle.tips["k_eq"], state.deflection]
        return pickle.dumps([None if part is None else np.ascontiguousarray(part).tobytes() for part in parts])

    whole = [told(cycle) for cycle in Coupling(problem).cycles()]
    for stop in (2, 9):
        coupling, seen = Coupling(problem), []
        run = coupling.cycles()
        for _ in range(stop):
            seen.append(told(next(run)))
        kept: list = []
        coupling.between = lambda coupling=coupling, kept=kept: kept.append(
            checkpoint_file.write(tmp_path, checkpoint_file.identity() | {"cycle": len(kept)}, coupling)
        )
        seen.append(told(next(run)))
        again = checkpoint_file.read(kept[0])
        rest = [told(cycle) for cycle in again.load_steps()]
        assert seen[:stop] + rest == whole


@pytest.mark.parametrize(("aperture", "stress", "law"), [(np.inf, 1e6, 0), (0.0, -5e6, 1)])
def test_specimens_under_uniform_stress_stay_of_first_order(aperture, stress, law):
    """Bit for bit: cracks bend the outline, but no load works on that."""
    *_, plain = cycles(specimen(1, SLANTED, aperture, stress, law))
    *_, found = cycles(specimen(AUTO_ORDER, SLANTED, aperture, stress, law))
    assert found.state.order.tolist() == [1]
    for name in ("k_i", "k_ii"):
        assert np.array_equal(found.tips[name], plain.tips[name])
    assert np.array_equal(found.state.vertices, plain.state.vertices)


def test_cracked_bricks_of_a_wall_stay_of_first_order_at_its_cost():
    """A wall at rest under its weight: the state of order 1 to the bit. Of 25 steps only some are estimated."""
    problem = cracked_wall(60, 8)
    problem = replace(problem, dda=replace(problem.dda, equilibrium="start"))
    problem = replace(problem, run=replace(problem.run, end_time=0.25))
    *_, plain = cycles(problem)
    coupling = Coupling(of_order(problem, AUTO_ORDER))
    *_, found = coupling.cycles()
    assert (found.state.order == 1).all()
    assert np.array_equal(plain.state.vertices, found.state.vertices)
    assert np.array_equal(plain.state.velocity, found.state.velocity)
    assert coupling.now.system.order_choice.judged <= 5


@pytest.mark.slow
def test_a_notched_beam_that_drops_finds_its_order(tmp_path):
    """It flies at order 1, is raised when it hits, before its crack grows, and pays for the growth: to a fifth of that of
    order 8 with the default target."""
    text = BEAM.read_text(encoding="utf-8").replace("end_time_s = 0.04", "end_time_s = 0.026")
    grown = {}
    for order in ('"auto"', "8"):
        path = tmp_path / f"beam_{order.strip(chr(34))}.toml"
        path.write_text(text.replace("order = 6", f"order = {order}"), encoding="utf-8")
        seen = [cycle for cycle in cycles(load_scene(path).problem()) if cycle.number]
        last = grown[order] = seen[-1].statistics
        assert last["fracture_energy"] + last["parting_energy"] == pytest.approx(last["toughness_energy"], rel=0.05)
        assert max(abs(cycle.statistics["budget_residual"]) for cycle in seen) < 0.01
        if order == '"auto"':
            flies = [cycle for cycle in seen if cycle.state.time < 0.02]
            assert flies and all(cycle.state.order[0] == 1 for cycle in flies)
            assert seen[-1].state.order[0] >= 5
    assert grown['"auto"']["toughness_energy"] == pytest.approx(grown["8"]["toughness_energy"], rel=0.2)
