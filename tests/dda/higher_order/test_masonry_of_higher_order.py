"""Masonry of blocks that bend: voussoir beams and arches that stand by their shape (`geomech.reference.blocks.masonry`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import rectangle
from scenes_of_cells import columns_and_rows, glued, moved_corners

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State
from geomech.reference.blocks import masonry

GRAVITY, DENSITY, RADIUS = 9.81, 2500.0, 10.0


def weight(factor: float = 1.0) -> Loads:
    return Loads(gravity=History.constant((0.0, -factor * GRAVITY)))


def voussoir_beam(span: float, order: int, columns: int, rows: int, youngs_modulus: float = 2e10) -> dda.BlockSystem:
    """A beam 1 m deep of two halves between fixed abutments, each of ``columns`` × ``rows`` cells, or one block."""
    abutments = [rectangle(-1, -2, 0, 3), rectangle(span, -2, span + 1, 3)]
    cells = columns_and_rows(np.linspace(0, span, 2 * columns + 1), np.linspace(0, 1, rows + 1))
    n = len(cells)
    blocks = Blocks.from_polygons(abutments + cells, fixed=[1, 1] + [0] * n, order=[1, 1] + [order] * n)
    if columns * rows > 1:
        blocks = glued(blocks)
        right = np.array([cell[:, 0].mean() > 0.5 * span for cell in [*abutments, *cells]])
        pairs = np.asarray(blocks.glued)
        half = right[blocks.vertex_block[pairs]]
        blocks = replace(blocks, glued=pairs[half[:, 0] == half[:, 1]])
    joint = JointLaw("joint", np.radians(60), normal_stiffness=1e12, shear_stiffness=1e12)
    settings = DdaSettings(dynamic_factor=0.0, time_step=1.0, max_displacement_ratio=0.02)
    return dda.BlockSystem(blocks, [Material("stone", youngs_modulus, 0.0, DENSITY)], [joint], settings=settings)


def at_rest(system: dda.BlockSystem, span: float, factor: float = 1.0) -> tuple[float, float, float] | None:
    """Thrust N, sag of the crown m, and the part of the abutment that bears: three times the distance of the thrust from
    its edge, as under a triangular pressure; None where the beam falls."""
    try:
        found = dda.equilibrium(system, State.at_rest(system.blocks), weight(factor))
    except dda.NotConverged:
        return None
    crown = np.abs(system.blocks.vertices[:, 0] - 0.5 * span) < 1e-9
    sag = -float(moved_corners(system, found.state)[crown, 1].mean())
    if not found.converged or sag > 0.9:
        return None
    rows = found.state.face_points
    rows = rows[(rows["block"] == 0) | (rows["other"] == 0)]
    thrust = float(rows["normal_force"].sum())
    return thrust, sag, 3.0 * float(rows["normal_force"] @ rows["point"][:, 1]) / thrust


def against_sofianos(state_figure, span: float, cases: dict[str, tuple[int, int, int]]) -> list[float]:
    """Errors of the thrust for halves of name → (order, columns, rows)."""
    errors = []
    for name, case in cases.items():
        found = at_rest(voussoir_beam(span, *case), span)
        assert found is not None
        thrust, sag, bears = found
        errors.append(thrust / masonry.voussoir_thrust(span, 1.0, DENSITY * GRAVITY, sag) - 1)
        print(
            f"S/T = {span:g}, {name}: thrust off by {errors[-1]:+.4f}, sag {1e3 * sag:.4f} mm, {bears:.3f} of the abutment "
            f"bears (Sofianos {masonry.voussoir_contact(span, 1.0):.3f})"
        )
        state_figure(f"voussoir beam, span/depth {span:g}, halves of {name}: thrust", errors[-1], "Sofianos 1996")
    return errors


@pytest.mark.parametrize("span", [5.0, 10.0])
def test_thrust_of_a_voussoir_beam_of_higher_order(verified, span):
    """His fit to finite elements is good to some hundredths. Orders 2 and 3 bear at the corners of one block, as if rigid."""
    columns = round(span)
    cases = {f"one block of order {order}": (order, 1, 1) for order in (2, 3, 8)}
    cases |= {f"cells of order {order}, two over the depth": (order, columns, 2) for order in (2, 3)}
    one_2, one_3, one_8, cells_2, cells_3 = against_sofianos(verified, span, cases)
    assert -0.2 < one_2 < one_3 < -0.08
    assert abs(one_8) < 0.025 and abs(cells_3) < 0.025
    assert -0.1 < cells_2 < -0.04


def test_soft_halves_do_not_fall_before_they_bear():
    """E = 1 GPa: the sag grows with the order. A beam of any order may also fall freely without any contact force, as those
    of order 3 and 5 did in the first static step, by 25 mm."""
    sags = []
    for order in (3, 4, 5, 8):
        found = at_rest(voussoir_beam(10.0, order, 1, 1, 1e9), 10.0)
        assert found is not None
        sags.append(found[1])
    assert np.all(np.diff(sags) > 0) and sags[-1] < 0.025


@pytest.mark.slow
@pytest.mark.parametrize("span", [5.0, 10.0])
def test_thrust_of_a_voussoir_beam_converges(verified, span):
    columns = round(span)
    cases = {f"cells of order {o}, {n} over the depth": (o, columns * n // 2, n) for o in (2, 3) for n in (4, 8)}
    errors = against_sofianos(verified, span, cases)
    assert max(map(abs, errors)) < 0.03
    # All agree with one another better than with his fit.
    assert np.ptp(errors[1:]) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("order", "columns", "rows"), [(8, 1, 1), (3, 10, 2)])
def test_a_voussoir_beam_snaps_through(verified, order, columns, rows):
    """In theory thrust grows with w ∝ z (z₀² − z²) of a fixed arm z₀; bearing areas shrink as the halves rotate, so that the
    load is some tenth higher, as for bricks of first order (`test_dda_masonry`)."""
    span = 10.0
    system = voussoir_beam(span, order, columns, rows, 1e9)
    arm = 1 - 2 / 3 * masonry.voussoir_contact(span, 1.0)

    def load(z: float) -> float:
        return z * (arm**2 - z**2)

    first = at_rest(system, span)
    assert first is not None
    theory = load(arm / np.sqrt(3)) / load(arm - first[1])
    stands, falls = 0.8 * theory, 1.5 * theory
    assert at_rest(system, span, stands) is not None and at_rest(system, span, falls) is None
    while falls / stands > 1.01:
        trial = 0.5 * (stands + falls)
        stands, falls = (trial, falls) if at_rest(system, span, trial) else (stands, trial)
    last = at_rest(system, span, 0.99 * stands)
    assert last is not None
    print(
        f"order {order}: snaps through at {stands / theory:.3f} of the load of theory, sag {last[1] / arm:.3f} of its arm"
    )
    name = f"voussoir beam that snaps through, halves of {columns * rows} of order {order}: load"
    verified(name, None, "Sofianos 1996", found=stands / theory, exact=1.0)
    assert 1.0 < stands / theory < 1.2
    assert last[1] / arm == pytest.approx(masonry.SNAP_THROUGH_SAG, rel=0.2)


def arch(n: int, ratio: float, order: int) -> dda.BlockSystem:
    """``n`` voussoirs of this ``order`` between two fixed springings; friction of 60°, so that only hinges can form."""
    inner, outer = RADIUS * (1 - 0.5 * ratio), RADIUS * (1 + 0.5 * ratio)
    springings = [rectangle(inner, -1, outer, 0), rectangle(-outer, -1, -inner, 0)]
    blocks = Blocks.from_polygons(
        springings + masonry.voussoirs(n, ratio, RADIUS), fixed=[1, 1] + [0] * n, order=[1, 1] + [order] * n
    )
    settings = DdaSettings(dynamic_factor=0.0, max_displacement_ratio=0.01)
    stone = Material("stone", 1e11, 0.2, DENSITY)
    return dda.BlockSystem(blocks, [stone], [JointLaw("joint", np.radians(60))], settings=settings)


def stands(n: int, ratio: float, order: int) -> bool:
    """Whether the arch moves by less than 0.1 mm in the third of static steps of 1 s: 2e-5 g."""
    system = arch(n, ratio, order)
    state = State.at_rest(system.blocks)
    for _ in range(3):
        before, state = state.vertices, system.step(state, weight(), 1.0).state
    return float(np.abs(state.vertices - before).max()) < 1e-4


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("n", [6, 12, 25])
def test_an_arch_of_higher_order_stands_and_falls_where_limit_analysis_says(n, order):
    """Couplet's and Heyman's arch: thrust reaches the edges of the joints, whose pressure there is high and whose hinges
    are as close to the edge as elastic stones allow: 2e-3 of the thickness."""
    thinnest = masonry.thinnest_arch(n)
    assert stands(n, 1.002 * thinnest, order)
    assert not stands(n, 0.998 * thinnest, order)
