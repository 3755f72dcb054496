"""The two ways to draw a specimen, Gmsh and plain TOML, give identical arrays."""

from pathlib import Path

import numpy as np
import pytest

from geomech.scene import load_scene

PIPELINES = Path(__file__).parents[2] / "pipelines"


def assert_same(a, b):
    """Bit for bit: both routes are rounded to the same twelve digits."""
    for name in a.__dataclass_fields__:
        x, y = getattr(a, name), getattr(b, name)
        assert np.array_equal(x, y) if isinstance(x, np.ndarray) else x == y, name


@pytest.mark.parametrize("variant", ["phi_0", "phi_30", "phi_60", "phi_90"])
def test_two_cracks(variant):
    model = load_scene(PIPELINES / "two_cracks", variant=variant).problem()
    drawn = load_scene(PIPELINES / "two_cracks" / "toml.toml", variant=variant).problem()
    assert_same(model.blocks, drawn.blocks)
    assert_same(model.cracks, drawn.cracks)
    assert model.joints == drawn.joints and model.joint_of == drawn.joint_of and model.materials == drawn.materials
    assert model.gauge == drawn.gauge and model.monitors == drawn.monitors and model.load_edge == drawn.load_edge
    assert (model.dda, model.ddm, model.growth, model.run) == (drawn.dda, drawn.ddm, drawn.growth, drawn.run)


def test_single_flaw():
    model = load_scene(PIPELINES / "single_flaw").problem()
    drawn = load_scene(PIPELINES / "single_flaw" / "toml.toml").problem()
    assert_same(model.blocks, drawn.blocks)
    assert_same(model.cracks, drawn.cracks)
    assert model.joint_of == drawn.joint_of and model.gauge == drawn.gauge


def test_the_specimens_are_the_published_ones():
    """Haeri et al. 2014 (60 × 120 mm, cracks of 10 mm, 0.2 MPa/s); Wong et al. 2002 (50 × 170 mm, flaw of 20 mm)."""
    p = load_scene(PIPELINES / "two_cracks", variant="phi_90").problem()
    assert p.blocks.areas()[0] == pytest.approx(0.06 * 0.12, rel=1e-14)
    assert p.cracks.lengths == pytest.approx([0.01, 0.01], rel=1e-10)
    assert np.isinf(p.cracks.aperture).all() and p.blocks.fixed.tolist() == [False, True, False]
    # The upper platen only comes down; without friction nothing else would keep it in place.
    assert np.flatnonzero(p.blocks.constrained[2]).tolist() == [0, 2, 5] and not p.blocks.constrained[0].any()
    rock = p.materials[p.blocks.material[0]]
    assert (rock.youngs_modulus, rock.poissons_ratio, rock.k_ic) == (17e9, 0.21, 2e6)
    (top,) = p.loads.edge_tractions
    assert top.history.at(10.0).tolist() == [0.0, -2e6]
    (edge,) = p.blocks.edges_named("load:top")
    # The traction acts on as much of the platen as the specimen is wide.
    width = np.hypot(*(p.blocks.vertices[p.blocks.next_vertex[edge]] - p.blocks.vertices[edge]))
    assert width == pytest.approx(0.06, abs=1e-15)
    assert p.joints[p.joint_index("contact:top", "contact:top")].friction_angle == 0.0

    q = load_scene(PIPELINES / "single_flaw").problem()
    assert q.blocks.areas()[0] == pytest.approx(0.05 * 0.17, rel=1e-14)
    assert q.cracks.lengths == pytest.approx([0.02], rel=1e-10) and q.growth.increment == 2e-3
