"""What cement between crack faces releases as it breaks, and what a filling stores, have their places in the budget."""

from __future__ import annotations

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

ROCK = Material("rock", 17e9, 0.21, 2200.0, k_ic=1e12)


def told(law: JointLaw, lines, loads: Loads, blocks: Blocks, steps: int, end: float, block=0, **crack) -> list[dict]:
    """The statistics of all steps at rest of ``blocks`` with cracks along ``lines`` that do not grow."""
    given = Problem(
        title="cemented",
        blocks=blocks,
        cracks=Cracks.from_polylines([np.array(line) for line in lines], block=block, aperture=0.0, **crack),
        materials=(ROCK,),
        joints=(JointLaw("glue", 0.6, 1e12, 1e12),),
        face_laws=(law,),
        loads=loads,
        dda=DdaSettings(time_step=end / steps, dynamic_factor=0.0, max_displacement_ratio=0.1),
        growth=GrowthSettings(increment=0.05),
        run=RunSettings(end_time=end),
    )
    return [cycle.statistics for cycle in cycles(given) if cycle.number]


def plate(rate: float) -> dict:
    """1 × 2 m, pulled along its length (``rate`` > 0, Pa/s) or pressed."""
    outline = np.array([[-0.5, -1.0], [0.5, -1.0], [0.5, 1.0], [-0.5, 1.0]])
    edges = (EdgeTraction(name, History.ramp([0.0, way * rate])) for name, way in (("top", 1.0), ("bottom", -1.0)))
    blocks = Blocks.from_polygons([outline], edge_names=[[["bottom", "", "top", ""]]])
    return {"blocks": blocks, "loads": Loads(edge_tractions=tuple(edges))}


def test_cement_of_a_crack_releases_what_griffith_s_crack_needs():
    """A crack across the pull, cemented to 1 MPa: at that stress all of it breaks at once, and the work of the load that
    stays, 2π a² σ²/E', is half stored (Griffith 1921) and half released. The step in which it breaks ends at
    1.02 MPa; sides add 1 % to the opening."""
    strength, a = 1e6, 0.05
    law = JointLaw("cement", friction_angle=0.5, tensile_strength=strength)
    seen = told(law, [[[-a, 0.0], [a, 0.0]]], steps=34, end=1.02, **plate(1e6))
    whole, broken = seen[-2], seen[-1]
    assert whole["crack_bond_loss"] == 0.0 and whole["crack_elastic"] < 1e-12
    half = np.pi * a**2 * strength * 1.02e6 / ROCK.plane_modulus
    assert broken["crack_bond_loss"] == pytest.approx(half, rel=0.02)
    assert broken["crack_elastic"] / broken["crack_bond_loss"] == pytest.approx(1.02, rel=1e-3)
    assert abs(broken["crack_residual"]) < 1e-4 * half
    assert abs(broken["budget_residual"]) < 1e-4


@pytest.mark.parametrize("stiffness", [None, 2e11])
def test_cement_that_breaks_by_and_by_adds_up(stiffness):
    """A beam of 8 × 1 m glued to a wall bends under its growing weight: the cement of cracks in its upper side lets
    go one crack after the other, rigid or with a filling. (What it released was told as left over.)"""
    wall = np.array([[-2.0, -1.0], [0.0, -1.0], [0.0, 2.0], [-2.0, 2.0]])
    beam = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 1.0], [0.0, 1.0]])
    law = JointLaw(
        "cement", friction_angle=0.5, cohesion=1e6, tensile_strength=1e6,
        normal_stiffness=stiffness, shear_stiffness=stiffness,
    )  # fmt: skip
    seen = told(
        law, [[[x, 1.0], [x + 0.05, 0.7]] for x in (1.0, 2.5, 4.0)], Loads(gravity=History.ramp([0.0, -9.81])),
        Blocks.from_polygons([wall, beam], fixed=[True, False]), 12, 1.0, block=1, surface=[(True, False)] * 3,
    )  # fmt: skip
    bond = np.array([one["crack_bond_loss"] for one in seen])
    assert np.count_nonzero(np.diff(bond) > 0) >= 2 and (np.diff(bond) >= 0).all()
    last = seen[-1]
    spent = last["crack_work"] + last["uneven_work"]
    assert bond[-1] > 0.1 * spent
    assert last["crack_elastic"] + bond[-1] + last["crack_friction"] == pytest.approx(spent, rel=1e-4)
    assert max(abs(one["crack_residual"]) for one in seen) < 1e-4 * spent


def test_what_a_filling_stores_is_stored():
    """A filled joint through most of a plate that is pressed, at 45°, so strong that nothing slips: σ²/2k_n and τ²/2k_s
    of its area were all there was left over. The strain of a joint that goes through would be that of the springs."""
    law = JointLaw("filled", friction_angle=0.9, cohesion=1e9, normal_stiffness=5e10, shear_stiffness=2e10)
    (seen,) = told(law, [[[-0.4, -0.4], [0.4, 0.4]]], steps=1, end=1.0, **plate(-1e6))
    stress, length = 0.5e6, 0.8 * np.sqrt(2)
    springs = 0.5 * length * stress**2 * (1 / 5e10 + 1 / 2e10)
    assert 0.3 * springs < seen["crack_elastic"] < springs
    assert seen["crack_friction"] == seen["crack_bond_loss"] == 0.0
    assert seen["crack_elastic"] == pytest.approx(seen["crack_work"] + seen["uneven_work"], rel=1e-4)
