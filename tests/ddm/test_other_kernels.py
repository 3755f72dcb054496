"""Symmetric plates broken by other kernels of the BLAS library, each in a process of its own: another order of
summation, as on another processor, must not change what breaks."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
#: Kernels that every x86-64 processor of the last ten years can run; the machine's own is the other to compare with.
KERNELS = ("Nehalem", "Haswell")
_RUN = """
import json, sys
import numpy as np
from geomech import ddm
from geomech.model import Cracks, GrowthSettings, Material

rock = Material("rock", 17e9, 0.21, 2200.0, 1e6)
top, bottom = np.array([[0.03, 0.09], [-0.03, 0.09]]), np.array([[-0.03, -0.09], [0.03, -0.09]])
pull = np.array([[[0.0, 1.0]] * 2, [[0.0, -1.0]] * 2])
load = ddm.BodyLoad(segments=np.array([top, bottom]), tractions=pull)
loop = np.array([[-0.03, -0.09], [0.03, -0.09], [0.03, 0.09], [-0.03, 0.09]])
lines = {
    "across": [[[-0.003, 0.0], [0.003, 0.0]]],
    "two in a line": [[[-0.015, 0.0], [-0.009, 0.0]], [[0.009, 0.0], [0.015, 0.0]]],
    "en echelon": [[[-0.012, -0.004], [-0.003, -0.004]], [[0.003, 0.004], [0.012, 0.004]]],
}
told = {}
for name, of in lines.items():
    cracks = Cracks.from_polylines([np.array(line) for line in of])
    steps = list(ddm.propagate([loop], cracks, rock, load, GrowthSettings(increment=6e-3), control="toughness"))
    told[name] = [
        [step.load_factor, [event.kind for event in step.events], step.cracks.segments.tolist(),
         step.cracks.nodes.tolist()]
        for step in steps if step.solution is not None
    ]
json.dump(told, sys.stdout)
"""


def _told(kernel: str | None) -> dict:
    """What the run above comes to by a kernel of OpenBLAS."""
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), environment.get("PYTHONPATH", "")])
    if kernel is not None:
        environment["OPENBLAS_CORETYPE"] = kernel
    done = subprocess.run(
        [sys.executable, "-c", _RUN], env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_symmetric_plates_break_alike_by_every_kernel():
    """Cracks in a plate 60 mm wide in increments of 6 mm, 9 and 3 mm from its edges or 9 mm from one another: what
    grows and joins, and in which order, is the same by all kernels, places and loads to what rounding leaves (1e-6 of
    an increment, 1e-7)."""
    own = _told(None)
    assert all(len(steps) > 2 for steps in own.values())
    # The plate and the crack across it are their own images, and stay so.
    for _, _, _, nodes in own["across"]:
        x = np.sort(np.array(nodes)[:, 0])
        assert x == pytest.approx(-x[::-1], abs=1e-12)
    for kernel in KERNELS:
        other = _told(kernel)
        for name, steps in own.items():
            assert len(other[name]) == len(steps), (kernel, name)
            for (load, events, segments, nodes), (load_2, events_2, segments_2, nodes_2) in zip(steps, other[name]):
                assert (events_2, segments_2) == (events, segments), (kernel, name)
                assert load_2 == pytest.approx(load, rel=1e-7)
                np.testing.assert_allclose(nodes_2, nodes, atol=1e-6 * 6e-3)
