"""Digitised traces are left with the vertices that say where they are."""

import numpy as np
import pytest

from geomech.shapes.traces.simplification import simplified


def test_vertices_within_the_tolerance_go_and_ends_still_meet():
    """A straight line digitised in 50 sides with a noise of 1 mm, a kink of it, and a line that ends on its middle."""
    rng = np.random.default_rng(0)
    x = np.linspace(0, 5, 51)
    long = np.column_stack([x, np.where(x > 2.5, 0.4 * (x - 2.5), 0.0)])
    long[1:-1] += rng.uniform(-1e-3, 1e-3, (49, 2))
    on = 0.5 * (long[10] + long[11])
    other = np.array([on + [0, 1], on])
    alone = np.array([[0.0, -1.0], [1.0, -1.0], [1.0, -2.0]])
    found = simplified([long, other, alone], 5e-3, 1e-6)
    lines = found.lines
    assert (found.before, found.after) == (50 + 1 + 2, 2 + 1 + 2)
    np.testing.assert_array_equal(lines[0][[0, -1]], long[[0, -1]])
    assert np.abs(lines[0][1] - [2.5, 0]).max() < 0.15
    assert 1e-4 < found.off <= 5e-3 + 1e-6
    # The end lies on the line as it now is.
    a, b = lines[0][:2]
    way = (b - a) / np.hypot(*(b - a))
    rest = lines[1][1] - a
    assert abs(rest[0] * way[1] - rest[1] * way[0]) < 1e-12
    assert np.hypot(*(lines[1][1] - on)) < 5e-3 + 1e-6
    np.testing.assert_array_equal(lines[2], alone)


def test_nothing_is_left_out_of_corners():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    found = simplified([square], 0.1, 1e-6)
    assert found.off == 0.0 and len(found.lines[0]) == 4
    assert simplified([], 0.1, 1e-6).after == 0


@pytest.mark.parametrize("name", ["kb7"])
def test_a_map_keeps_its_nodes(tmp_path, name):
    """KB7 of fractopo's sample data (see `test_trace_maps`), left with sides that are off by 2 cm at most: two thirds of
    them, half of their turns, the same traces and as many nodes where traces meet, to one in twenty."""
    from test_trace_maps import loaded

    from geomech.scene import load_scene

    _, before = loaded(name, tmp_path)
    scene = tmp_path / "scene.toml"
    scene.write_text(scene.read_text().replace('file = "traces.csv"', 'file = "traces.csv"\nsimplify_m = 0.02'))
    after = load_scene(scene)
    assert any("simplify_m" in fault.message for fault in after.warnings)
    sides = [sum(len(line) - 1 for joint in s.drawing.jointed.joints for line in joint.lines) for s in (before, after)]
    assert sides[1] < 0.75 * sides[0]
    nodes = [s.drawing.jointed.cutting.nodes for s in (before, after)]
    for kind in ("X", "Y", "I"):
        assert abs(nodes[1][kind] - nodes[0][kind]) <= max(2, 0.05 * nodes[0][kind]), (kind, nodes)
