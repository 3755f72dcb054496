"""Pressure under a flat punch without friction on an elastic half-plane: rigid, and of the same rock.

Rigid: p = P/(π √(a² − x²)) (Sadowsky 1928; Johnson 1985, Contact Mechanics, sec. 2.8). Of the same rock p ~ r^(λ − 1) at
the corners, r from there, λ = 0.774 (Dundurs & Lee 1972, J. Elasticity 2, 109-112); its moments are compared with finite
elements. The half-plane is 40 a by 20 a: pressures differ by (a/20a)², some 1e-4, from those of an endless one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre
from scenes_of_bending import after, rectangle
from scenes_of_cells import columns_and_rows, glued
from scipy.optimize import brentq

from geomech import dda
from geomech.model import Blocks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, PointMotion

ROCK = Material("rock", 2e10, 0.25, 2500.0)
#: m: half width of the half-plane and its depth; height of the punch, of half width 1.
REACH, HEIGHT = 20.0, 4.0
PRESSURE = 1e6
#: ∫ p x² dx / P, ∫ p x⁴ dx / P and the work of the load, J/m: punch of the same rock, by the finite elements of
#: `test_reference_of_the_elastic_punch`; the rigid one in closed form.
ELASTIC, WORK, RIGID = (0.394033, 0.260479), 393.391, (0.5, 0.375)
#: Each of the cells at the corners of the punch is this fraction of the one beside it.
RATIO = 0.25


def beyond(start: float, end: float, first: float, growth: float) -> np.ndarray:
    """Nodes from ``start`` (not included) to ``end``, the first at a distance of about ``first``."""
    out, size = [start], first
    while out[-1] < end:
        out.append(out[-1] + size)
        size *= growth
    way = np.array(out[1:]) - start
    return start + way * (end - start) / way[-1]


def nodes(n: int, layers: int, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates of cells: under half of the punch, ``n`` equal ones, the last divided in ``layers`` towards the corner;
    beyond it, divided in the same way; and downwards."""
    under = np.concatenate(
        [np.linspace(0, 1, n + 1)[:-1], 1 - RATIO ** np.arange(1, layers + 1) / n, [1.0]]
    )  # fmt: skip
    last, growth = under[-1] - under[-2], 2.0 if layers else 1.6
    mirrored = 2.0 - under[::-1][1:] if layers else np.zeros(0)
    start, size = (mirrored[-1], mirrored[-1] - mirrored[-2]) if layers else (1.0, last)
    return under, np.concatenate([mirrored, beyond(start, reach, size, growth)]), beyond(0.0, reach, last, growth)


def both_sides(x: np.ndarray) -> np.ndarray:
    return np.concatenate([-x[:0:-1], x])


def punch(order: int, n: int, layers: int, elastic: bool, reach: float = REACH) -> tuple[dda.BlockSystem, int]:
    """The system, and the number of its first block that belongs to the punch; ``n`` = 0: of two blocks."""
    if n == 0:
        below, above = [rectangle(-reach, -reach, reach, 0)], [rectangle(-1, 0, 1, HEIGHT)]
        return joined(below, above, order, elastic)
    under, outside, down = nodes(n, layers, reach)
    half_plane = columns_and_rows(both_sides(np.concatenate([under, outside])), np.concatenate([-down[::-1], [0.0]]))
    above = [rectangle(-1, 0, 1, HEIGHT)]
    if elastic:
        up = beyond(0.0, HEIGHT, under[-1] - under[-2], 2.0)
        above = columns_and_rows(both_sides(under), np.concatenate([[0.0], up]))
    return joined(half_plane, above, order, elastic)


def joined(half_plane, above, order: int, elastic: bool) -> tuple[dda.BlockSystem, int]:
    """As `punch`, of the cells of both bodies."""
    depth = -min(cell[:, 1].min() for cell in half_plane)
    polygons = [rectangle(-depth - 1, -depth - 1, depth + 1, -depth), *half_plane, *above]
    names = [[["loaded" if side[1] > HEIGHT - 1e-9 else "" for side in 0.5 * (p + np.roll(p, -1, axis=0))]]
             for p in polygons]  # fmt: skip
    orders = [1] + [order] * len(half_plane) + [order if elastic else 1] * len(above)
    blocks = glued(
        Blocks.from_polygons(polygons, fixed=[1] + [0] * (len(polygons) - 1), order=orders, edge_names=names)
    )
    first = 1 + len(half_plane)
    pairs = np.asarray(blocks.glued, int).reshape(-1, 2)
    side = blocks.vertex_block[pairs] < first
    material = np.where(np.arange(len(polygons)) < first, 0, 0 if elastic else 1)
    blocks = replace(blocks, glued=pairs[side[:, 0] == side[:, 1]] if len(polygons) > 3 else None, material=material)
    # 1e14 Pa/m gives way by 1e-8 m, the rock by 1e-4 m.
    smooth = JointLaw("smooth", 0.0, normal_stiffness=1e14, shear_stiffness=1e14)
    settings = DdaSettings(dynamic_factor=0.0, time_step=10.0, max_displacement_ratio=1.0)
    steel = Material("steel", 2e16, 0.25, 2500.0)
    return dda.BlockSystem(blocks, [ROCK, steel], [smooth], settings=settings), first


def pressed(system: dda.BlockSystem, first: int) -> tuple[np.ndarray, dda.StepResult]:
    """FACE_POINT rows between the punch and the half-plane; nothing but this load moves the punch sideways."""
    blocks = system.blocks
    corner = np.where(blocks.vertices[:, 1] > HEIGHT - 1e-9, np.abs(blocks.vertices[:, 0]), np.inf)
    top = int(blocks.vertex_block[np.argmin(corner)])
    still = PointMotion(top, (0.0, HEIGHT), History.constant((0.0,)), direction=(1.0, 0.0))
    load = EdgeTraction("loaded", History.constant((0.0, -PRESSURE)))
    result = after(system, Loads(edge_tractions=(load,), point_motions=(still,)), 2)
    rows = result.state.face_points
    own = (rows["block"] >= first) != (rows["other"] >= first)
    return rows[own & (np.minimum(rows["block"], rows["other"]) > 0)], result


def moments(rows: np.ndarray) -> np.ndarray:
    """(2,) ∫ p x² dx / P and ∫ p x⁴ dx / P."""
    x, force = rows["point"][:, 0], rows["normal_force"]
    return np.array([force @ x**2, force @ x**4]) / force.sum()


def pressure(rows: np.ndarray, degree: int) -> np.ndarray:
    """(n, 2) x and p at points of faces, p the polynomial of this ``degree`` with the moments of the face's forces."""
    face = np.stack([rows[name] for name in ("vertex", "edge", "far_vertex", "far_edge")], axis=1)
    out, samples = [], np.linspace(-0.9, 0.9, 9)
    for of in np.unique(face, axis=0):
        own = rows[(face == of).all(axis=1)]
        x, force = own["point"][:, 0], own["normal_force"]
        start, length = x.min(), np.ptp(x)
        t = 2 * (x - start) / length - 1
        parts = [(2 * k + 1) / length * (force @ legendre.Legendre.basis(k)(t)) for k in range(degree + 1)]
        out.append(np.stack([start + 0.5 * (samples + 1) * length, legendre.legval(samples, parts)], axis=1))
    return np.concatenate(out)


def wedge(angle: float, exponent: float) -> float:
    """Displacement over pressure of the face θ = 0 of a wedge, its other face free, under the pressure r^(λ − 1), without
    shear (Williams 1952, J. Appl. Mech. 19, 526-528)."""
    above, below = exponent + 1, exponent - 1

    def rows(t: float) -> list[list[float]]:
        return [
            [np.cos(above * t), np.sin(above * t), np.cos(below * t), np.sin(below * t)],
            [-above * np.sin(above * t), above * np.cos(above * t), -below * np.sin(below * t), below * np.cos(below * t)],
        ]  # fmt: skip

    return -np.linalg.solve(np.array(rows(0.0) + rows(angle)), [1.0, 0.0, 0.0, 0.0])[3]


#: λ: where a quarter-plane and a half-plane of the same rock give way by the same amount.
EXPONENT = brentq(lambda x: wedge(np.pi / 2, x) + wedge(np.pi, x), 0.6, 0.95)


def test_exponents_of_both_punches():
    assert pytest.approx(0.774, abs=1e-3) == EXPONENT
    assert brentq(lambda x: wedge(np.pi, x), 0.4, 0.6) == pytest.approx(0.5)


@pytest.mark.parametrize("elastic", [False, True])
def test_pressure_of_cells_that_are_finer_at_its_corners(verified, elastic):
    """Two layers of cells, 1/16 of the width at the corners: spectral in the order until the smallest cell shows."""
    errors, exact = [], np.array(ELASTIC if elastic else RIGID)
    for order in (2, 3, 4):
        rows, result = pressed(*punch(order, 1, 2, elastic))
        errors.append(float(np.abs(moments(rows) / exact - 1)[0]))
    name = "of the same rock" if elastic else "rigid"
    verified(
        f"flat punch, {name}, cells in two layers towards its corners: second moment of pressure", errors,
        "finite elements" if elastic else "Sadowsky 1928", over=("order", (2, 3, 4)),
    )  # fmt: skip
    assert errors[2] < errors[1] / 2 < errors[0] / 4
    assert errors[2] < (5e-4 if elastic else 6e-3)
    if elastic:
        assert result.energy.elastic == pytest.approx(WORK, rel=1e-4)
    else:
        at, found = pressure(rows, 2).T
        inner = np.abs(at) < 0.8
        assert found[inner] == pytest.approx(2 * PRESSURE / np.pi / np.sqrt(1 - at[inner] ** 2), rel=0.04)


def test_pressure_between_two_blocks_of_one_polynomial_each(verified):
    """The half-plane is one block three times as wide and high as the half of the punch: what polynomials can follow."""
    orders = (2, 3, 5, 8)
    rows, result = pressed(*punch(4, 1, 2, True, 3.0))
    exact, best, errors, works = moments(rows), result.energy.elastic, [], []
    for order in orders:
        rows, result = pressed(*punch(order, 0, 0, True, 3.0))
        errors.append(float(abs(moments(rows) / exact - 1)[0]))
        works.append(1 - result.energy.elastic / best)
    print(f"moments {errors}, energy {works}, exact {exact}")
    name = "flat punch of one block on one block of six half widths: "
    verified(name + "second moment of pressure", errors, "cells of order 4", over=("order", orders))
    verified(name + "energy", works, "cells of order 4", over=("order", orders))
    # Energy converges from below; the pressure itself oscillates where it is singular, and points of faces lift off.
    assert works == sorted(works, reverse=True) and 0 < works[-1] < 0.015
    assert errors[0] > errors[1] > max(errors[2:]) and max(errors[2:]) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("order", [2, 3, 4])
def test_pressure_of_equal_cells_converges_as_its_singularity_allows(verified, order, elastic):
    """Errors decrease as h^(2λ), λ = ½ and 0.774, and faster than 1/p."""
    sizes = (1, 2, 4)
    exact = np.array(ELASTIC if elastic else RIGID)
    errors = [float(abs(moments(pressed(*punch(order, n, 0, elastic))[0]) / exact - 1)[0]) for n in sizes]
    rate = np.log2(errors[0] / errors[-1]) / 2
    print(f"order {order}, {'elastic' if elastic else 'rigid'}: {errors}, rate {rate:.2f}")
    verified(
        f"flat punch, {'of the same rock' if elastic else 'rigid'}, equal cells of order {order}: second moment of pressure",
        errors, "finite elements" if elastic else "Sadowsky 1928", over=("cells under half of the punch", sizes),
    )  # fmt: skip
    assert rate > (1.3 if elastic else 0.85)


@pytest.mark.slow
def test_pressure_at_the_corner_of_an_elastic_punch_has_its_exponent(verified):
    rows, _ = pressed(*punch(4, 1, 3, True))
    at, found = pressure(rows, 2).T
    r = 1 - np.abs(at)
    some = (r > 0.01) & (r < 0.1)
    slope = np.polyfit(np.log(r[some]), np.log(found[some]), 1)[0]
    print(f"p ~ r^{slope:.4f}, should be {EXPONENT - 1:.4f}; moments {moments(rows) / ELASTIC - 1}")
    verified(
        "flat punch of the same rock: exponent of the pressure at its corners", None, "Dundurs & Lee 1972",
        found=slope, exact=EXPONENT - 1,
    )  # fmt: skip
    assert slope == pytest.approx(EXPONENT - 1, abs=0.02)
    assert moments(rows) == pytest.approx(np.array(ELASTIC), rel=3e-4)


@pytest.mark.slow
def test_reference_of_the_elastic_punch():
    """Nine-node elements on a grid that is refined to 6e-6 a at the corner; half of the problem."""
    skfem = pytest.importorskip("skfem", reason="pip install 'geomech[bench]'")
    from scipy import sparse
    from scipy.sparse.linalg import splu
    from skfem.helpers import ddot, eye, sym_grad, trace

    stiffness = ROCK.stiffness()
    mu, lame = float(stiffness[2, 2]), float(stiffness[0, 1])
    form = skfem.BilinearForm(
        lambda u, v, _: ddot(2 * mu * sym_grad(u) + eye(lame * trace(sym_grad(u)), 2), sym_grad(v))
    )
    load = skfem.LinearForm(lambda v, _: -PRESSURE * v[1])
    under = np.concatenate([np.linspace(0, 1, 9)[:-1], 1 - 0.5 ** np.arange(1, 15) / 8, [1.0]])
    last = 1 - under[-2]
    down, out = beyond(0.0, REACH, last, 1.5), beyond(1.0, REACH, last, 1.5)
    grids = (
        (np.concatenate([under, out]), np.concatenate([-down[::-1], [0.0]])),
        (under, np.concatenate([[0.0], beyond(0.0, HEIGHT, last, 1.5)])),
    )
    bases = [
        skfem.Basis(skfem.MeshQuad.init_tensor(*grid), skfem.ElementVector(skfem.ElementQuad2()), intorder=4)
        for grid in grids
    ]
    matrix = sparse.block_diag([form.assemble(basis) for basis in bases]).tocsr()
    first, n = bases[0].N, sum(basis.N for basis in bases)
    at, upward = np.concatenate([basis.doflocs for basis in bases], axis=1), np.zeros(n, bool)
    for basis, shift in zip(bases, (0, first), strict=True):
        of = basis.dofs
        upward[shift + np.concatenate([of.nodal_dofs[1], of.facet_dofs[1], of.interior_dofs[1]])] = True
    top = bases[1].mesh.facets_satisfying(lambda x: x[1] > HEIGHT - 1e-9)
    force = np.zeros(n)
    force[first:] = load.assemble(skfem.FacetBasis(bases[1].mesh, bases[1].elem, facets=top, intorder=4))
    on_face = upward & (np.abs(at[1]) < 1e-12) & (at[0] < 1 + 1e-9)
    lower, upper = (np.flatnonzero(on_face & ((np.arange(n) < first) == below)) for below in (True, False))
    lower, upper = lower[np.argsort(at[0, lower])], upper[np.argsort(at[0, upper])]
    held = (upward & (at[1] < -REACH + 1e-9)) | (~upward & (np.abs(at[0]) < 1e-12))
    free = np.setdiff1d(np.flatnonzero(~held), upper)
    column = np.full(n, -1)
    column[free] = np.arange(len(free))
    rows = np.concatenate([free, upper])
    tied = sparse.csr_matrix(
        (np.ones(len(rows)), (rows, np.concatenate([column[free], column[lower]]))), (n, len(free))
    )
    moved = tied @ splu(sparse.csc_matrix(tied.T @ matrix @ tied)).solve(tied.T @ force)
    reaction, x = (matrix @ moved - force)[upper], at[0, upper]
    assert reaction @ x**2 / reaction.sum() == pytest.approx(ELASTIC[0], abs=2e-5)
    assert reaction @ x**4 / reaction.sum() == pytest.approx(ELASTIC[1], abs=2e-5)
    # Work of half of the load, which is the energy of both halves.
    assert force @ moved == pytest.approx(WORK, rel=1e-5)
