"""Excavation in cells and blocks of higher order: a hole in stressed rock against elasticity, and where the energy of
what is taken out goes."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scenes_of_bending import rectangle, system_of
from scenes_of_cells import cells_of, columns_and_rows, moved_corners, stress_in
from scenes_of_cells import system as system_with

from geomech import dda
from geomech.dda.energy_balance import EnergyBudget
from geomech.model import EdgeTraction, Excavation, History, InSituStress, JointLaw, Loads, Material, State

ROCK = Material("rock", 1e10, 0.25, 2600.0)
GRAVITY = History.constant((0.0, -9.81))
#: Pressures, Pa, of the rock along x and y.
ALONG, ACROSS = 1e6, 2e6
#: m: radius of the hole and of the disc.
INNER, OUTER = 1.0, 20.0


def disc(sectors: int, order: int) -> dda.BlockSystem:
    """A disc of rings of cells; the innermost, triangles about the middle, fill the hole."""
    turn = np.linspace(0, 2 * math.pi, sectors + 1)[:-1]
    way = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    radius = [INNER, 1.25, 1.6, 2.1, 2.8, 4.0, 6.0, 9.0, 13.0, OUTER]
    nxt = np.roll(way, -1, axis=0)
    cells = [np.array([[0.0, 0.0], *(INNER * np.array([a, b]))]) for a, b in zip(way, nxt, strict=True)]
    cells += [
        np.array([r * a, s * a, s * b, r * b]) for r, s in pairwise(radius) for a, b in zip(way, nxt, strict=True)
    ]
    edge = 0.999 * OUTER * math.cos(math.pi / sectors)
    return cells_of(cells, order, rock=ROCK, loaded=lambda at: math.hypot(*at) > edge)


def pressed(system: dda.BlockSystem) -> tuple[dda.BlockSystem, tuple[EdgeTraction, ...]]:
    """Every edge of the outline has a name and the traction of the uniform stress."""
    blocks, tractions = system.blocks, []
    names, labels = np.zeros(blocks.n_vertices, int), [""]
    for k, edge in enumerate(blocks.edges_named("loaded").tolist()):
        normal = blocks.outward_normals[edge]
        names[edge] = k + 1
        labels.append(f"out{k}")
        tractions.append(EdgeTraction(f"out{k}", History.constant((-ALONG * normal[0], -ACROSS * normal[1]))))
    return system_with(replace(blocks, edge_name=names, edge_names=tuple(labels)), rock=ROCK), tuple(tractions)


def annulus(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stress (n, 3), Pa, and displacement (n, 2), m, at ``x`` (n, 2) of a ring, plane strain, whose inner pressure is
    released while the outer tractions stay.

    Lamé's solution for the mean stress; for the rest Michell's functions (A r² + B r⁴ + C/r² + D) cos 2θ (J. R. Barber,
    Elasticity, tables 8.1 and 9.1), free of traction inside and unchanged outside.
    """
    a, b, nu = INNER, OUTER, ROCK.poissons_ratio
    shear, kappa = ROCK.youngs_modulus / (2 * (1 + nu)), 3 - 4 * nu
    mean, dev = 0.5 * (ALONG + ACROSS), 0.5 * (ALONG - ACROSS)
    rows = [row for r in (a, b) for row in ([-2, 0, -6 / r**4, -4 / r**2], [2, 6 * r**2, -6 / r**4, -2 / r**2])]
    # What was there: σr = −mean − dev cos 2θ, τ = dev sin 2θ.
    A, B, C, D = np.linalg.solve(np.array(rows), [dev, -dev, 0.0, 0.0])
    lame = mean * a**2 / (b**2 - a**2)
    r, theta = np.hypot(*x.T), np.arctan2(x[:, 1], x[:, 0])
    c2, s2 = np.cos(2 * theta), np.sin(2 * theta)
    radial = lame * (b**2 / r**2 - 1) - (2 * A + 6 * C / r**4 + 4 * D / r**2) * c2
    hoop = -lame * (b**2 / r**2 + 1) + (2 * A + 12 * B * r**2 + 6 * C / r**4) * c2
    tau = (2 * A + 6 * B * r**2 - 6 * C / r**4 - 2 * D / r**2) * s2
    out = -lame * ((1 - 2 * nu) * r + b**2 / r) / (2 * shear)
    out = out + (-2 * A * r - (3 - kappa) * B * r**3 + 2 * C / r**3 + (kappa + 1) * D / r) * c2 / (2 * shear)
    around = (2 * A * r + (3 + kappa) * B * r**3 + 2 * C / r**3 - (kappa - 1) * D / r) * s2 / (2 * shear)
    c, s = np.cos(theta), np.sin(theta)
    stress = np.stack(
        [
            radial * c * c + hoop * s * s - 2 * tau * s * c - ALONG,
            radial * s * s + hoop * c * c + 2 * tau * s * c - ACROSS,
            (radial - hoop) * s * c + tau * (c * c - s * s),
        ],
        axis=1,
    )
    return stress, np.stack([out * c - around * s, out * s + around * c], axis=1)


def hole(sectors: int, order: int) -> tuple[float, float, float, float]:
    """Of an excavated hole: the rms error of stress at the middles of cells within three radii, over the largest stress,
    the largest error of the wall's displacement, over the largest, and of the budget, over the energy taken out: its
    error and its residual."""
    system, tractions = pressed(disc(sectors, order))
    field = InSituStress(np.array([-ALONG, -ACROSS, 0.0]))
    rest = dda.in_situ_state(system, field, Loads(edge_tractions=tractions))
    assert rest.settled < 1e-12 * OUTER
    turn = np.linspace(0, 2 * math.pi, 60, endpoint=False)
    polygon = 1.01 * INNER * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    loads = Loads(edge_tractions=tractions, excavations=(Excavation(15.0, polygon=polygon),))
    state, budget = rest.state, EnergyBudget()
    for _ in range(4):
        removed = system.removed(loads, state.time)
        result = system.step(state, loads)
        dug = removed is not None and state.removed is None
        budget = (budget.cut() if dug else budget).after(result.energy, result.state.time)
        state = result.state
    assert state.removed.sum() == sectors and state.removed[:sectors].all()
    core = INNER**2 * 0.5 * sectors * math.sin(2 * math.pi / sectors)
    stress = field.stress
    taken = 0.5 * core * float(stress @ ROCK.compliance() @ stress)
    middle = np.array([system.blocks.area_moments(b)[1] for b in range(system.blocks.n_blocks)])
    near = np.flatnonzero(~state.removed & (np.hypot(*middle.T) < 3.0))
    error = np.abs(stress_in(system, state, near, middle[near]) - annulus(middle[near])[0]).max(axis=1)
    at = system.blocks.vertices
    wall = np.flatnonzero((np.abs(np.hypot(*at.T) - INNER) < 1e-9) & ~state.removed[system.blocks.vertex_block])
    exact = annulus(at[wall])[1]
    off = np.hypot(*(moved_corners(system, state)[wall] - exact).T).max() / np.hypot(*exact.T).max()
    largest = 3 * ACROSS - ALONG
    return (
        float(np.sqrt((error**2).mean())) / largest, float(off), abs(budget.split + taken) / taken,
        abs(budget.residual) / taken,
    )  # fmt: skip


def test_a_hole_in_stressed_rock_is_kirschs():
    """Cells of order 2, a hole of 32 sides: a ring of radius 20 (Kirsch for an infinite one)."""
    stress, wall, taken, residual = hole(32, 2)
    print(f"stress {stress:.2e}, wall {wall:.2e}, energy {taken:.1e}, residual {residual:.1e}")
    assert stress < 0.01
    assert wall < 0.02
    assert taken < 1e-9
    assert residual < 1e-3


@pytest.mark.slow
def test_finer_sides_bring_the_hole_nearer():
    """64 sides, order 3: what is left is the area that chords take from the circle."""
    stress, wall, taken, residual = hole(64, 3)
    print(f"stress {stress:.2e}, wall {wall:.2e}, energy {taken:.1e}, residual {residual:.1e}")
    assert stress < 0.003
    assert wall < 0.005
    assert taken < 1e-9
    assert residual < 1e-3


@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_a_roof_that_bends_loses_a_pillar(factor):
    """A roof of order 4 on three pillars of order 2, the middle one is mined: what goes is what it stores and the springs of
    its faces, and the roof sags between the others."""
    polygons = [rectangle(-1, -1, 7, 0), *(rectangle(x, 0, x + 1, 3) for x in (0.0, 2.5, 5.0)), rectangle(0, 3, 6, 4)]
    settings = {"dynamic_factor": factor, "time_step": 10.0 if factor == 0.0 else 1e-3}
    system = system_of(
        polygons, [True, False, False, False, False], [1, 2, 2, 2, 4], joint=JointLaw("face", 0.6),
        rock=Material("rock", 2e9, 0.2, 2500.0), **settings,
    )  # fmt: skip
    found = dda.equilibrium(system, State.at_rest(system.blocks), Loads(gravity=GRAVITY), tolerance=1e-9)
    assert found.converged
    step = settings["time_step"]
    loads = Loads(gravity=GRAVITY, excavations=(Excavation(2 * step, (2,)),))
    state, budget, before = found.state, EnergyBudget(), None
    for k in range(5 if factor == 0.0 else 30):
        result = system.step(state, loads)
        if k == 2:
            budget, before = budget.cut(), state
        budget = budget.after(result.energy, result.state.time)
        state = result.state
    pillar = 0.5 * 3.0 * float(before.stress[2] @ system.materials[0].compliance() @ before.stress[2])
    assert -1.3 * pillar < budget.split < -pillar
    assert abs(budget.residual) < 1e-3 * abs(budget.split)
    assert not state.stress[2].any() and state.removed.tolist() == [False, False, True, False, False]
    sag = system.deflected.largest(state.deflection[:, 0])[0]
    assert sag[4] > 2.0 * system.deflected.largest(before.deflection[:, 0])[0][4]
    assert sag[2] == 0.0


def test_cells_that_go_take_their_glue_with_them():
    """The outer half of a cantilever of cells is taken away: it bends as one of half its length does."""
    clamp = JointLaw("clamp", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)

    def tip(length: int, loads: Loads, steps: int) -> float:
        cells = columns_and_rows(np.linspace(0, length, 2 * length + 1), np.linspace(0, 1, 2))
        system = cells_of(cells, 3, below=[rectangle(-1, 0, 0, 1)], joint=clamp)
        state = State.at_rest(system.blocks)
        for _ in range(steps):
            state = system.step(state, loads).state
        there = np.abs(system.blocks.vertices[:, 0] - 4) < 1e-9
        there &= system.blocks.vertex_block <= 8
        return float(moved_corners(system, state)[there, 1].mean())

    half = tip(4, Loads(gravity=GRAVITY), 3)
    whole = tip(8, Loads(gravity=GRAVITY), 3)
    dug = Excavation(30.0, polygon=rectangle(4, -1, 9, 2))
    assert whole < 5 * half < 0
    assert tip(8, Loads(gravity=GRAVITY, excavations=(dug,)), 6) == pytest.approx(half, rel=1e-4)
