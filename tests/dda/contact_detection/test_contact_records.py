"""CONTACT rows are carried on as NumPy's own operations on their fields do."""

import numpy as np
import pytest

from geomech.dda.contact_detection import contact_records
from geomech.model import CONTACT, OPEN, STICK


@pytest.fixture
def rows():
    rng, out = np.random.default_rng(1), np.zeros(50, CONTACT)
    for name in CONTACT.names:
        kind = CONTACT[name].base.kind
        size = out[name].shape
        out[name] = rng.normal(size=size) if kind == "f" else rng.integers(0, 2 if kind == "b" else 3, size)
    out["vertex"], out["edge"] = rng.integers(0, 20, 50), rng.integers(0, 20, 50)
    return out


def test_rows_are_read_and_copied_as_they_are(rows):
    vertex, edge, keys, normal, lift, gap = contact_records.names(rows, 20)
    assert np.array_equal(vertex, rows["vertex"]) and np.array_equal(edge, rows["edge"])
    assert np.array_equal(keys, 20 * rows["vertex"] + rows["edge"]) and np.array_equal(normal, rows["normal"])
    assert lift == np.abs(rows["lift"]).max() and gap == rows["gap"][rows["state"] != OPEN].min()
    rows["state"][:], rows["gap"][:] = STICK, 1.0
    assert contact_records.names(rows, 20)[-1] == 0.0
    assert np.array_equal(contact_records.copied(rows), rows)


def test_what_is_inherited_is_that_of_the_parent_or_nothing(rows):
    parent = np.maximum(np.random.default_rng(2).integers(-20, 50, 30), -1)
    kinds, sizes, inset = contact_records.inherited(rows, parent)
    kept = {"state": kinds[0], "bonded": kinds[1], "inset": inset}
    of = ("normal_force", "shear_force", "slip", "wear", "lift", "stretch", "bare")
    kept |= dict(zip(of, sizes, strict=True))
    assert (parent < 0).any()
    for name, found in kept.items():
        assert np.array_equal(found, np.where(parent < 0, 0, rows[name][parent])), name


def test_carried_rows_lie_on_the_new_geometry_and_keep_the_rest(rows):
    vertices, following = np.random.default_rng(3).normal(size=(20, 2)), np.roll(np.arange(20), -1)
    before = rows.copy()
    new = contact_records.carried(rows, vertices, following)
    assert np.array_equal(rows, before)
    moved = ("point", "position", "normal")
    assert all(np.array_equal(new[name], rows[name]) for name in CONTACT.names if name not in moved)
    start = vertices[rows["edge"]]
    along = vertices[following[rows["edge"]]] - start
    foot = start + new["position"][:, None] * along
    assert np.array_equal(new["point"], vertices[rows["vertex"]])
    # The foot is where the vertex stands square on the edge, and the normal is the outward one of unit length.
    assert np.abs(((new["point"] - foot) * along).sum(axis=1)).max() < 1e-12
    across = np.stack([along[:, 1], -along[:, 0]], 1) / np.hypot(*along.T)[:, None]
    # Turned from there by their tilt, normals of rounded corners.
    (x, y), c, s = across.T, np.cos(rows["tilt"]), np.sin(rows["tilt"])
    assert np.allclose(new["normal"], np.stack([c * x - s * y, s * x + c * y], 1), 1e-13)
