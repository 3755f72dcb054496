"""The rockfall that comes as an example: where its rocks lose their energy."""

from pathlib import Path

import numpy as np

import geomech
from geomech.model.blocks.polygon import winding_number
from geomech.scene import load_scene

SCENE = Path(__file__).parents[3] / "geometry" / "rockfall.toml"


def test_rocks_fall_bounce_and_lose_their_energy_by_name():
    cycles = list(geomech.cycles(load_scene(SCENE, ["run.end_time_s=3.5"])))
    end = cycles[-1].statistics
    work = end["gravity_work"]
    # The slab weighs 1.5 m² of rock and has come down the cut, 12 m at least; the round rock as much less.
    assert work > 2600 * 9.81 * 12.0 * 2.0
    assert end["impact_loss"] > 0.5 * work and end["friction_loss"] > 0.02 * work
    # What neither is left nor has a name: rocks spin by up to 0.1 rad a step.
    begun = 0.5 * 2600.0 * float(cycles[0].blocks.areas() @ (cycles[0].state.velocity[:, :2] ** 2).sum(axis=1))
    named = end["impact_loss"] + end["friction_loss"] + end["kinetic_energy"] - begun
    assert abs(named - work) < 5e-3 * work
    blocks, vertices = cycles[-1].blocks, cycles[-1].state.vertices
    falling = [b for b, name in enumerate(blocks.names) if name != "ground"]
    centres = np.array([vertices[blocks.vertex_block == b].mean(axis=0) for b in falling])
    # All have left the crest, and none is in the ground.
    assert (centres[:, 1] < 18.0).all()
    ground = blocks.names.index("ground")
    outline = [vertices[blocks.vertex_block == ground]]
    assert not any(abs(winding_number(outline, centre)) > 0.5 for centre in centres)
