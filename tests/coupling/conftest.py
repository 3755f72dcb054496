"""Fixtures of the coupling's tests."""

import pytest
from small_scenes import PLATE

from geomech.scene import load_scene


@pytest.fixture
def torn_plate(tmp_path):
    """The problem of a plate with a crack, torn apart."""
    path = tmp_path / "plate.toml"
    path.write_text(PLATE, encoding="utf-8")
    return load_scene(path).problem()
