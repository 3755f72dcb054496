"""Small block systems that several tests share."""

from __future__ import annotations

import pytest
from block_problems import rectangle

from geomech.model import Blocks, Material


@pytest.fixture(scope="session")
def platens() -> tuple[Blocks, list[Material]]:
    """A 60 × 120 mm specimen between steel platens of its own width; the lower one is fixed, the upper one loaded."""
    blocks = Blocks.from_polygons(
        [rectangle(-0.03, -0.02, 0.03, 0.0), rectangle(-0.03, 0.0, 0.03, 0.12), rectangle(-0.03, 0.12, 0.03, 0.14)],
        fixed=[True, False, False],
        material=[1, 0, 1],
        edge_names=[[[""] * 4], [[""] * 4], [["", "", "load:top", ""]]],
        names=["base", "specimen", "platen"],
    )
    return blocks, [Material("rock", 17e9, 0.21, density=2600.0), Material("steel", 200e9, 0.3, density=7800.0)]
