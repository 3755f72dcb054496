"""Boundary loads of many blocks found together, against those of each found alone."""

from dataclasses import fields

import numpy as np
import pytest

from geomech.bench.slopes.random_slopes import scene_text
from geomech.coupling.cycle import Coupling
from geomech.coupling.load_transfer import boundary_tractions
from geomech.ddm.loads.body_loads import resultants
from geomech.scene import load_scene


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    """What the loads of a random slope's blocks, more than one of them cracked, were last asked for with."""
    path = tmp_path_factory.mktemp("slope") / "slope.toml"
    path.write_text(scene_text(48), encoding="utf-8")
    problem, calls = load_scene(path).problem(), []
    found = boundary_tractions.boundary_loads
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(boundary_tractions, "boundary_loads", lambda *given: calls.append(given) or found(*given))
        for cycle in Coupling(problem).cycles():
            if cycle.load_step == 3:
                break
    assert len(calls[-1][0]) > 2
    return calls[-1]


def same(a, b):
    for of in fields(boundary_tractions.BoundaryLoad):
        mine, others = getattr(a, of.name), getattr(b, of.name)
        np.testing.assert_equal(mine, others)


def test_loads_do_not_depend_on_what_else_is_asked_for(asked):
    """To the bit: a block's pieces, body force, even stress and imbalance are its own."""
    numbers, blocks, forces, inertia = asked
    together = boundary_tractions.boundary_loads(*asked)
    for k in range(len(numbers)):
        own = numbers[k : k + 1], blocks, forces, inertia.only(np.array([k]))
        same(together[k], boundary_tractions.boundary_loads(*own)[0])


def test_what_finds_no_room_is_found_again(asked, monkeypatch):
    """Rows for which there was no room are counted, and all is found anew with as much as it takes."""
    with_room, tried = boundary_tractions._with_room, []
    whole = boundary_tractions.boundary_loads(*asked)
    monkeypatch.setattr(boundary_tractions, "_with_room", lambda given, room: tried.append(room) or with_room(given, 1))
    for mine, others in zip(whole, boundary_tractions.boundary_loads(*asked), strict=True):
        same(mine, others)
    assert tried and len(whole[0].segments) > 1


def test_what_is_in_equilibrium_stays_so(asked):
    """Body force and pieces of every block have no resultant and no moment to round-off."""
    numbers, blocks = asked[:2]
    for b, load in zip(numbers.tolist(), boundary_tractions.boundary_loads(*asked)):
        area, centroid, second = blocks.area_moments(b)
        force, moment, size = resultants(load.segments, load.tractions, centroid)
        turned = load.body_force_gradient @ second
        assert size > 0 and np.abs(force + area * load.body_force).max() < 1e-12 * size
        assert abs(moment + turned[1, 0] - turned[0, 1]) < 1e-12 * size * np.sqrt(area)
