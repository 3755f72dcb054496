"""Bodies without the factors of their boundary: loads and K take A_CΓ A_ΓΓ⁻¹ alone; growth and fields inside compute the
factors again."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from geomech import ddm
from geomech.ddm import condensation
from geomech.ddm.system import schur_complement
from geomech.ddm.system.boundary_system import KEPT_BESIDE_FACTORS, BoundarySystem
from geomech.model import Cracks, DdmSettings, JointLaw, Material

ROCK = Material("rock", 17e9, 0.21, k_ic=2e6)
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
FINE = DdmSettings(elements_per_side=24)
INSIDE = np.array([[0.5, 0.5], [-0.3, -0.7], [0.1, 0.4]])


def crack(half: float, aperture: float) -> Cracks:
    return Cracks.from_polylines([np.array([[-0.3, -0.05], [half, 0.1]])], aperture=aperture)


def sheared(body: ddm.Body) -> ddm.Solution:
    return body.solve(ddm.BodyLoad(remote_stress=[-1e6, 2e5, 5e5]))


def factors(solution: ddm.Solution) -> np.ndarray:
    return np.concatenate([solution.tips["k_i"], solution.tips["k_ii"]])


def size(body: ddm.Body) -> int:
    """Bytes that a body holds."""
    return len(pickle.dumps(body))


@pytest.mark.parametrize("aperture", [np.inf, 0.0])
def test_released_bodies_are_loaded_alike(aperture):
    body = ddm.Body([SQUARE], crack(0.3, aperture), ROCK, FINE)
    n = body.boundary.n_unknowns
    assert n > KEPT_BESIDE_FACTORS
    before = sheared(body)
    at, inside = factors(before), before.displacement(INSIDE)
    held = size(body)
    assert held < 1.5 * 8 * n * n  # factors, no matrix beside them
    body.release()
    assert size(body) < held - 8 * n * n
    again = sheared(body)
    assert np.array_equal(factors(again), at) and np.array_equal(again.displacement(INSIDE), inside)
    assert again.residual < 1e-9 and again.condition == before.condition


def test_bodies_with_friction_give_up_factors_of_open_faces(monkeypatch):
    """Of many, once their contact has factors of its own, from which later loads are solved to the same bits."""
    monkeypatch.setattr(schur_complement, "WORTHWHILE", 1)
    law = JointLaw("rough", friction_angle=0.3)
    body = ddm.Body([SQUARE], crack(0.3, 0.0), ROCK, FINE, face_laws=(law,))
    body.release()
    softness = body.compliance()
    first = sheared(body)
    assert "open_factor" in vars(body.crack_system) and body.crack_system.bases
    body.forget_states()
    assert "open_factor" not in vars(body.crack_system)
    assert np.array_equal(factors(sheared(body)), factors(first))
    assert np.array_equal(body.compliance(), softness)


def test_a_body_whose_cracks_have_grown_keeps_no_matrices_of_its_boundary():
    """Its earlier solutions still have their displacement inside."""
    body = ddm.Body([SQUARE], crack(0.3, 0.0), ROCK, FINE)
    body.release()
    body.lean = True
    before = sheared(body)
    held, inside = size(body), before.displacement(INSIDE)
    n = body.boundary.n_unknowns
    body.retire()
    assert size(body) < held - 8 * n * body.faces.n_unknowns
    assert np.array_equal(before.displacement(INSIDE), inside)
    assert np.array_equal(factors(sheared(body)), factors(before))


def test_released_bodies_grow_alike():
    """K and displacement as of a body made for the grown crack, to round-off; the factors are then kept."""
    body = ddm.Body([SQUARE], crack(0.3, np.inf), ROCK, FINE)
    body.release()
    nodes = np.concatenate([body.cracks.nodes, [[0.34, 0.12]]])
    longer = Cracks(
        nodes=nodes,
        segments=np.array([[0, 1], [1, 2]]),
        crack=np.zeros(2, int),
        block=np.zeros(2, int),
        birth_cycle=np.array([0, 1]),
        aperture=np.full(2, np.inf),
        surface=np.zeros(3, bool),
        names=body.cracks.names,
    )
    grown = ddm.Body([SQUARE], longer, ROCK, FINE, ddm.Reuse(body))
    assert grown.counts["boundary_factorisations"] == 0 and grown._outside.is_factored
    fresh = ddm.Body([SQUARE], longer, ROCK, FINE)
    one, other = sheared(grown), sheared(fresh)
    assert np.abs(factors(one) - factors(other)).max() < 1e-11 * np.abs(factors(other)).max()
    moved = other.displacement(INSIDE)
    assert np.abs(one.displacement(INSIDE) - moved).max() < 1e-11 * np.abs(moved).max()


def grown_by(n: int, aperture: float) -> Cracks:
    """The crack with ``n`` straight increments."""
    line = np.array([[-0.3, -0.05], [0.3, 0.1], *[[0.3 + 0.04 * k, 0.1 + 0.02 * k * k / 5] for k in range(1, n + 1)]])
    known = Cracks.from_polylines([line], aperture=aperture)
    return Cracks(**{name: getattr(known, name) for name in vars(known) if name != "birth_cycle"}, birth_cycle=np.arange(n + 1))  # fmt: skip


@pytest.mark.parametrize("aperture", [np.inf, 0.0])
def test_growth_of_one_of_many_bodies_costs_what_is_new(monkeypatch, aperture):
    """Increment by increment, with factors of the boundary from the first one only: K is that of a body made for the grown
    crack. After a load step without growth what growth needed is given up, and comes again with the next increment."""
    factored, made = [], BoundarySystem._factored
    monkeypatch.setattr(BoundarySystem, "_factored", lambda system, matrix: factored.append(1) or made(system, matrix))
    bodies = [ddm.Body([SQUARE], grown_by(0, aperture), ROCK, FINE)]
    bodies[0].release()
    columns = []
    influence = condensation.influence_on_boundary
    monkeypatch.setattr(
        condensation, "influence_on_boundary", lambda system, faces, of: columns.append(len(of)) or influence(system, faces, of)
    )  # fmt: skip
    for n in range(1, 6):
        if n == 5:
            bodies[-1].end_step()
            assert bodies[-1].for_growth == 8 * bodies[-1].boundary.n_unknowns ** 2
            bodies[-1].end_step()
            assert bodies[-1].for_growth == 0
        columns.clear(), factored.clear()
        bodies.append(ddm.Body([SQUARE], grown_by(n, aperture), ROCK, FINE, ddm.Reuse(bodies[-1])))
        # Columns of all elements are computed once for the rows of new ones, and not kept.
        assert len(factored) == (n in (1, 5)) and (sum(columns) < 2 * bodies[-1].faces.n or n in (1, 5))
        bodies[-2].retire()
        grown = factors(sheared(bodies[-1]))
        fresh = factors(sheared(ddm.Body([SQUARE], grown_by(n, aperture), ROCK, FINE)))
        assert np.abs(grown - fresh).max() < 1e-8 * np.abs(fresh).max()
