"""Stress within one block of order p: a Brazilian disc, and a slab whose weight is applied at once."""

from __future__ import annotations

import numpy as np
import pytest
from scenes_of_bending import body_of, moved, rectangle

from geomech import dda, ddm
from geomech.model import Blocks, Cracks, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State

POINTS = np.array([[0.0, 0.0], [0.3, 0.2], [0.0, 0.5], [-0.4, 0.0], [-0.2, -0.6]])
#: Pa, on two sides of 5° at either end of a diameter.
PRESSURE, SIDES = 1e6, 72


def disc() -> np.ndarray:
    """(`SIDES`, 2) a disc of radius 1 with corners at the ends of its diameters."""
    return np.column_stack([f(2 * np.pi * np.arange(SIDES) / SIDES) for f in (np.cos, np.sin)])


def loaded_sides() -> dict[str, list[int]]:
    quarter = SIDES // 4
    return {"top": [quarter - 1, quarter], "bottom": [3 * quarter - 1, 3 * quarter]}


def stress_in_block(order: int) -> np.ndarray:
    """(n, 3) stress of one block at `POINTS`, Pa."""
    names = [""] * SIDES
    for name, sides in loaded_sides().items():
        for side in sides:
            names[side] = name
    blocks = Blocks.from_polygons([disc()], order=[order], edge_names=[[names]])
    settings = DdaSettings(dynamic_factor=0.0, time_step=10.0, max_displacement_ratio=1.0)
    rock = Material("rock", 2e10, 0.25, 2500.0)
    system = dda.BlockSystem(blocks, [rock], [JointLaw("joint", 0.6)], settings=settings)
    loads = Loads(
        edge_tractions=tuple(
            EdgeTraction(name, History.constant((0.0, -way * PRESSURE))) for name, way in (("top", 1), ("bottom", -1))
        )
    )
    state = system.step(State.at_rest(blocks), loads).state
    return body_of(system, state, 0).fields(POINTS)[0]


def stress_by_boundary_elements() -> np.ndarray:
    """(n, 3) the same by the crack solver, on the same polygon."""
    corners = disc()
    segments, tractions = [], []
    for name, sides in loaded_sides().items():
        way = 1.0 if name == "top" else -1.0
        for side in sides:
            segments.append([corners[side], corners[(side + 1) % SIDES]])
            tractions.append([[0.0, -way * PRESSURE]] * 2)
    body = ddm.Body([corners], Cracks.from_polylines([]), Material("rock", 2e10, 0.25, 2500.0))
    return body.solve(ddm.BodyLoad(segments=np.array(segments), tractions=np.array(tractions))).stress(POINTS)


def test_a_brazilian_disc_of_one_block(verified):
    """Tension across and pressure along the loaded diameter: Hondros (1959), Austral. J. Appl. Sci. 10, 243-268, at the
    centre, and boundary elements everywhere."""
    expected, alpha = stress_by_boundary_elements(), np.radians(5.0)
    largest = np.abs(expected).max()
    hondros = 2 * PRESSURE / np.pi * np.array([np.sin(2 * alpha) - alpha, -np.sin(2 * alpha) - alpha])
    errors = []
    for order in (3, 5, 7):
        found = stress_in_block(order)
        errors.append(float(np.abs(found - expected).max() / largest))
        # From order 3 on the stress at the centre is exact. (The polygon's chords make it 1e-3 less than Hondros's.)
        assert found[0] == pytest.approx(expected[0], abs=1e-5 * largest)
        assert found[0, :2] == pytest.approx(hondros, rel=2e-3)
    # A load on 5.6 % of the outline has more of the higher degrees near it, 0.4 radii away.
    verified(
        "Brazilian disc as one block: stress within 0.6 radii", errors, "boundary elements", over=("order", (3, 5, 7))
    )
    assert errors[0] < 0.3 and errors[1] < 0.18 and errors[2] < 0.09


def test_a_wide_slab_whose_weight_is_applied_at_once(verified):
    """A slab of 10 m by 1 m, ν = 0, on fixed rock: the wave u = u₀(z) − Σ Aₙ sin kₙz cos ω_n t of a bar, with u₀ = −ρg
    (hz − z²/2)/E, kₙ = (n − ½) π/h, Aₙ = −2ρg/(E h kₙ³). The slab is shortened by twice as much as at rest."""
    rock, height, g = Material("rock", 2e10, 0.0, 2500.0), 1.0, 9.81
    stiff = JointLaw("joint", 0.6, cohesion=1e9, tensile_strength=1e9, normal_stiffness=1e15, shear_stiffness=1e15)
    period = 4 * height / np.sqrt(rock.youngs_modulus / rock.density)
    k = (np.arange(1, 200) - 0.5) * np.pi / height
    unit = rock.density * g / rock.youngs_modulus

    def exact(z: float, t: np.ndarray) -> np.ndarray:
        waves = (
            2
            * unit
            / (height * k**3)
            * np.sin(k * z)
            * np.cos(2 * np.pi * np.outer(t, 2 * k * height / np.pi) / period)
        ).sum(axis=1)
        return -unit * (height * z - z * z / 2) + waves

    errors, largest = [], unit * height**2
    for order in (1, 3, 5):
        blocks = Blocks.from_polygons(
            [rectangle(-6, -1, 6, 0), rectangle(-5, 0, 5, height)], fixed=[1, 0], order=[1, order]
        )
        settings = DdaSettings(
            dynamic_factor=1.0, newmark=(0.25, 0.5), damping=0.0, time_step=period / 100, max_displacement_ratio=0.1
        )
        system = dda.BlockSystem(blocks, [rock], [stiff], settings=settings)
        state, times, top = State.at_rest(blocks), [], []
        for _ in range(100):
            state = system.step(state, Loads(gravity=History.constant((0.0, -g)))).state
            times.append(state.time)
            at = state.vertices - blocks.vertices
            top.append(at[-1, 1] if order == 1 else moved(system, state, 1, [0.0, height])[1])
        errors.append(float(np.abs(np.array(top) - exact(height, np.array(times))).max() / largest))
    verified(
        "wide slab under sudden weight: shortening over a period", errors, "wave in a bar", over=("order", (1, 3, 5))
    )
    assert errors[0] < 0.3 and errors[1] < 0.02 and errors[2] < 0.01
