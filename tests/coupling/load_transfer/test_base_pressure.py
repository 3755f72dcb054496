"""Pressures on rigid bases assumed from an earlier solution: resultants, and bounds of K with them."""

from dataclasses import replace

import numpy as np
import pytest

from geomech import ddm
from geomech.coupling.load_transfer.base_pressure import with_earlier_pressure
from geomech.coupling.load_transfer.boundary_tractions import BoundaryLoad
from geomech.ddm.fracture.sif_bound import TipBound
from geomech.ddm.fracture.sif_change_bound import ChangeBound
from geomech.ddm.loads.rigid_bases import Base, on_bases
from geomech.model import Cracks, Material

ROCK = Material("rock", 20e9, 0.25, 2500.0, 1e12)
SLAB = np.array([[-1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [-1.0, 1.0]])
PIECES = 24


def body(aperture: float) -> ddm.Body:
    lines = [np.array([[0.0, 0.15], [0.0, 0.35]]), np.array([[0.3, 0.2], [0.5, 0.5]])]
    return ddm.Body([SLAB], Cracks.from_polylines(lines, aperture=aperture), ROCK)


def pressed(at: float, size: float, slope: float = 0.0, base: tuple[float, float] = (-1.0, 1.0)) -> BoundaryLoad:
    """A load of ``size`` N/m on 0.4 m about ``at`` of the top, borne by a linear pressure on the ``base`` with ``slope`` times as much shear,
    and shear on the top in balance."""
    low, high = base
    x = np.linspace(low, high, PIECES + 1)
    length, arm = high - low, at - low - slope  # the shear acts 1 m lower than its counterpart
    p = size * np.interp(x, base, [4 / length - 6 * arm / length**2, 6 * arm / length**2 - 2 / length])
    way = np.array([slope, 1.0])
    below = np.stack([x[:-1], x[1:]], axis=1)[:, :, None] * [1.0, 0.0]
    tractions = np.stack([p[:-1], p[1:]], axis=1)[:, :, None] * way
    top = np.array([[[at + 0.2, 1.0], [at - 0.2, 1.0]], [[1.0, 1.0], [-1.0, 1.0]]])
    above = np.array([[[0.0, -size / 0.4]] * 2, [[-slope * size / 2.0, 0.0]] * 2])
    return BoundaryLoad(
        np.concatenate([top, below]), np.concatenate([above, tractions]), np.zeros(2), np.zeros((2, 2)),
        SLAB.mean(axis=0), 0.0, bases=((2 + np.arange(PIECES), way, np.inf),),
    )  # fmt: skip


def solved(of: ddm.Body, load: BoundaryLoad, warm=None) -> tuple[ddm.Solution, BoundaryLoad]:
    given = ddm.BodyLoad(
        segments=load.segments, tractions=load.tractions, body_force=load.body_force,
        body_force_gradient=load.body_force_gradient, about=load.about,
    )  # fmt: skip
    found = on_bases(of, given, [Base(*base) for base in load.bases], warm)
    return found, replace(load, tractions=found.load.tractions)


def resultants(load: BoundaryLoad) -> list[float]:
    a, b = load.segments[:, 0], load.segments[:, 1]
    s, t = load.tractions[:, 0], load.tractions[:, 1]
    length = np.hypot(*(b - a).T)[:, None]
    force = 0.5 * length * (s + t)
    about = [length[:, 0] * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]) / 6 for p, q in ((2 * a + b, s), (a + 2 * b, t))]
    return [*force.sum(axis=0), float(np.sum(about))]


def test_the_present_force_and_moment_are_kept_and_the_shape():
    of = body(np.inf)
    _, before = solved(of, pressed(0.1, 1e6))
    same = with_earlier_pressure(pressed(0.1, 2e6), before)
    assert same.tractions[2:] == pytest.approx(2 * before.tractions[2:], abs=1e-9 * np.abs(before.tractions).max())
    assert not same.bases
    moved = with_earlier_pressure(pressed(-0.2, 1.5e6, 0.2, (-1.0, 0.9)), before)
    assert resultants(moved) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert moved.segments[2:].tolist() == before.segments[2:].tolist()


def test_there_is_none_for_a_base_that_was_none():
    of = body(np.inf)
    load = pressed(0.1, 1e6)
    _, before = solved(of, load)
    assert with_earlier_pressure(load, replace(before, bases=())) is None
    turned = replace(load, segments=load.segments[..., ::-1].copy())
    assert with_earlier_pressure(turned, before) is None


@pytest.mark.parametrize("aperture", [np.inf, 0.0])
def test_bounds_hold_for_what_bases_press(aperture):
    """Loads that wander over the top and grow: K of the solution with the pressure that is found does not exceed the bound, for which none
    is. (That of changes is 37 to 470 times as large as the change.)"""
    of = body(aperture)
    first, before = solved(of, pressed(0.1, 1e6))
    bound = TipBound(of) if aperture else ChangeBound(of)
    if isinstance(bound, ChangeBound):
        bound.refer(before, first)
    for at, size, slope in ((0.1, 1.1e6, 0.0), (0.3, 1e6, 0.0), (-0.4, 0.7e6, 0.2), (0.6, 1e6, 0.0), (0.0, 2e6, -0.3)):
        load = pressed(at, size, slope)
        found, _ = solved(of, load, first)
        largest = np.hypot(found.tips["k_i"], found.tips["k_ii"])
        if isinstance(bound, TipBound):
            assert (largest <= bound.at_most(load)).all()
            continue
        known = np.hypot(first.tips["k_i"], first.tips["k_ii"])
        change, most = np.abs(largest - known), bound.change(with_earlier_pressure(load, before))
        assert (change <= 0.1 * most).all()
