"""Results of one load step of a specimen: K at its tips, and the load at which the first of them begins to grow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geomech.pipeline import cycles
from geomech.reference.specimens import two_cracks as published
from geomech.scene import load_scene

#: Name of a comparison → its changes of the scene.
FACES = {
    "open slots": (),
    "closed, no friction": ("cracks.default.aperture=closed",),
    "closed, friction 30°": ("cracks.default.aperture=closed", "cracks.default.joint=default"),
}
READINGS = {
    "φ from crack 1": (),
    "φ from the horizontal": ("geometry.parameters.phi_from=horizontal",),
}
QUADRATIC = ("ddm.order=2", "ddm.nodes=equal", "ddm.elements_per_crack=4")
KELVIN = ("run.boundary_stress=kelvin-springs",)
SETTINGS = {
    "this study's": (),
    "quadratic elements, equal nodes": QUADRATIC,
    "contact forces left at the corners": ("run.boundary_stress=springs",),
    "contact forces by Kelvin's solution": KELVIN,
    "the paper's: quadratic and Kelvin": (*QUADRATIC, *KELVIN),
}


@dataclass(frozen=True)
class FirstStep:
    """``k`` (2, n_tips) K_I and K_II at ``load`` Pa; ``initiation`` Pa, by what grows in proportion to the load;
    ``springs``: how far the loaded end has moved, over what the springs of its contacts give."""

    load: float
    k: np.ndarray
    initiation: float
    springs: float


def first_step(folder: Path, overrides: Sequence[str], phi: int, changes: Sequence[str] = ()) -> FirstStep:
    """The specimen with ``phi`` after its first step, with ``changes`` in place of the scene's settings."""
    only = ("run.end_time_s=1.0", "dda.time_step_s=1.0", "growth.enabled=false")
    scene = load_scene(folder, [*overrides, *only, *changes], f"phi_{phi}")
    *_, last = cycles(scene)
    tips = last.tips
    moved = abs(last.monitors["platen"][1]) / abs(last.statistics["worst_penetration"])
    return FirstStep(
        last.load,
        np.stack([tips["k_i"], tips["k_ii"]]),
        float(last.load * published.K_IC / tips["k_eq"].max()),
        float(moved),
    )
