"""Kernels are compiled once: arrays of one element count as contiguous however they were cut out of others, and a kernel
that takes such an array in one step and a strided one in the next is compiled for both."""

from __future__ import annotations

import subprocess
import sys

STEPS = """
import sys
import numpy as np
from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, State

rock, joint = Material("rock", 1e10, 0.25, 2600.0), JointLaw("joint", friction_angle=0.5)
floor = np.array([[-1.0, -1.0], [4.0, -1.0], [4.0, 0.0], [-1.0, 0.0]])
spike = np.array([[0.0, 1e-5], [1.0, 1.0], [0.0, 1.5], [-0.5, 1.0]])
box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
weight, counts = Loads(gravity=History.constant(np.array([0.1, -9.81]))), set()
for polygons in ([floor, spike], [floor, box, box + [2.0, 0.0]]):
    blocks = Blocks.from_polygons(polygons, fixed=[True] + [False] * (len(polygons) - 1))
    for factor in (0.0, 1.0):
        settings = DdaSettings(time_step=1e-3, dynamic_factor=factor)
        system, state = dda.BlockSystem(blocks, [rock], [joint], settings=settings), State.at_rest(blocks)
        for _ in range(4):
            state = system.step(state, weight).state
            counts.add(len(state.contacts))
print(*sorted(counts))
kernels = {
    f"{value.py_func.__module__}.{value.py_func.__name__}": len(value.signatures)
    for name, module in list(sys.modules.items()) if name.startswith("geomech.dda.")
    for value in vars(module).values() if hasattr(value, "signatures") and hasattr(value, "py_func")
}
print(sum(kernels.values()))
print(*(name for name, n in kernels.items() if n > 1))
"""


def test_kernels_of_steps_with_one_contact_serve_others_too():
    run = subprocess.run([sys.executable, "-c", STEPS], capture_output=True, text=True, check=True)
    contacts, compiled, more_than_once = run.stdout.splitlines()
    assert contacts == "1 4" and int(compiled) > 20
    assert more_than_once == ""
