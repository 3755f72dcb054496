"""Cracks under the polynomial stress of a block of higher order: their strain has a potential, and its first three
components are those of a block of uniform strain."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import ddm
from geomech.coupling.crack_compliance.block_stress_field import BlockStressField
from geomech.dda.higher_order.deflected_blocks import DeflectedBlocks
from geomech.model import Blocks, Cracks, Material, State

ROCK = Material("rock", 20e9, 0.25, 2500.0, 1e6)
OUTLINE = np.array([[0.0, 0.0], [2.0, 0.1], [1.8, 1.0], [0.2, 1.2]])
#: One crack inside, one that opens to the lower side.
LINES = [np.array([[0.5, 0.5], [0.9, 0.8]]), np.array([[1.2, 0.06], [1.25, 0.5]])]


def field(order: int) -> BlockStressField:
    blocks = Blocks.from_polygons([OUTLINE], order=[order])
    elastic = ROCK.stiffness()[None]
    deflected = DeflectedBlocks(blocks, np.zeros(1, bool), elastic)
    return BlockStressField.of(deflected, 0, ROCK.compliance())


def body(aperture: float = np.inf) -> ddm.Body:
    cracks = Cracks.from_polylines(LINES, aperture=aperture, surface=[(False, False), (True, False)])
    return ddm.Body([OUTLINE], cracks, ROCK)


@pytest.mark.parametrize("order", [2, 3, 5])
def test_the_mean_part_is_that_of_a_block_of_uniform_strain(order):
    """S of the mean stress as `ddm.Body.compliance` has it, and S symmetric and positive."""
    own, cracked = field(order), body()
    softness = own.compliance_of(cracked)
    assert softness.shape == (own.width, own.width)
    np.testing.assert_allclose(softness[:3, :3], cracked.compliance(), rtol=1e-9, atol=1e-9 * np.abs(softness).max())
    np.testing.assert_allclose(softness, softness.T)
    assert np.linalg.eigvalsh(softness).min() > -1e-9 * np.linalg.eigvalsh(softness).max()
    # Quadrature of the collocation nodes leaves Betti's symmetry to the accuracy of the elements.
    raw = own.crack_strain(cracked, cracked.jumps_under(own.traction(cracked)))
    assert np.abs(raw - raw.T).max() < 1e-3 * np.abs(raw).max()


def test_work_of_the_stress_on_the_crack_strain_is_that_at_the_cracks():
    """A Σ·e_c = ∫ t·[u] ds for any Σ, and twice the energy that open cracks add."""
    own, cracked = field(4), body()
    stress = np.random.default_rng(3).normal(size=own.width) * 1e6
    solution = cracked.solve(ddm.BodyLoad(intact=own.under(stress)))
    work = own.basis.area[0] * float(stress @ own.crack_strain(cracked, solution.jumps))
    assert work == pytest.approx(solution.work_at_cracks(solution.closed_traction), rel=1e-9)
    assert work == pytest.approx(2.0 * solution.crack_energy, rel=1e-4)


def test_fields_are_those_of_the_block():
    """Σ of a state gives the stress and the displacement that the block's own unknowns do."""
    own = field(3)
    rng = np.random.default_rng(5)
    blocks = own.blocks
    q = rng.normal(size=blocks.n_unknowns) * 1e-5
    state = State.at_rest(blocks.blocks)
    state.stress[0] = [1e6, -2e6, 5e5]
    state = State(**(vars(state) | {"deflection": np.stack([q, 0 * q], axis=1)}))
    points = np.array([[0.7, 0.5], [1.3, 0.8]])
    found = own.under(own.stress_of(state))
    strain = blocks.basis.strain(points, 0)[..., : own.width - 3] @ q
    np.testing.assert_allclose(found.stress(points), state.stress[0] + strain @ ROCK.stiffness().T, rtol=1e-9)
    bent = found.displacement(points) - own.under(np.r_[state.stress[0], np.zeros(own.width - 3)]).displacement(points)
    np.testing.assert_allclose(bent, blocks.basis.displacement(points, 0)[..., : own.width - 3] @ q, rtol=1e-9)


def test_what_such_a_field_does_not_fit_is_refused():
    own = field(2)
    cracks = Cracks.from_polylines(LINES[:1], aperture=np.inf)
    load = ddm.BodyLoad(intact=own.under(np.ones(own.width)))
    with pytest.raises(ValueError, match="bodies with an outline"):
        ddm.Body([], cracks, ROCK).solve(load)
    doubled = load.with_added(load)
    assert doubled.intact is not None
    np.testing.assert_allclose(doubled.intact.sizes, 2.0)
    np.testing.assert_allclose(load.scaled(-3.0).intact.sizes, -3.0)


def test_walls_of_holes_are_free_of_such_a_field():
    """Of a field without equilibrium inside, too: what it leaves on the walls is balanced by a body force."""
    own, x, y = field(3), 0.95, 0.35
    hole = np.array([[x - 0.05, y - 0.05], [x - 0.05, y + 0.05], [x + 0.05, y + 0.05], [x + 0.05, y - 0.05]])
    cracks = Cracks.from_polylines(LINES[:1], aperture=np.inf)
    sizes = 1e6 * np.random.default_rng(0).normal(size=own.width)
    solution = ddm.Body([OUTLINE, hole], cracks, ROCK).solve(ddm.BodyLoad(intact=own.under(sizes)))
    at = np.array([[x - 0.05 - 1e-7, y + 0.02], [x + 0.05 + 1e-7, y - 0.01]])
    intact = own.under(sizes).stress(at)
    left = solution.stress(at)
    assert np.abs(left[:, [0, 2]]).max() < 2e-3 * np.abs(intact).max() and np.abs(intact[:, 0]).min() > 1e5
