"""
Choose the step, springs, increment and order
=============================================

Every setting trades computing time for accuracy. This page measures both on two small scenes. You can do the same with
yours: halve the step and look at what changes.
"""

# %%
# The time step of a sliding slope
# --------------------------------
# We run 0.4 s of the scene of the :doc:`first run </start/first_run>`. The work of gravity is a good measure: it sums up
# in one number how far the moving rock has descended. The reference is the finest step.

import time as clock
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import geomech
from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, Material
from geomech.scene import load_scene

here = Path.cwd()  # the project's folder, or one below it
project = next(folder for folder in (here, *here.parents) if (folder / "docs").is_dir())
slope = project / "docs" / "start" / "my_slope.toml"


def fall(**dda) -> tuple[float, float]:
    """Work of the weight in 0.4 s, J/m, and processor time of the run, s."""
    scene = load_scene(slope, {"run.end_time_s": 0.4} | {f"dda.{key}": value for key, value in dda.items()})
    began = clock.process_time()
    for cycle in geomech.cycles(scene):
        pass
    spent = clock.process_time() - began
    blocks = cycle.blocks
    weight = 2600 * 9.81 * blocks.areas() * ~blocks.fixed
    return float(weight @ (cycle.motion.reference_centre - cycle.motion.centre)[:, 1]), spent


fall(time_step_s=0.04)  # compiles what is to be compiled
reference, _ = fall(time_step_s=0.002)
figure, axes = plt.subplots(figsize=(5.5, 3.8), layout="constrained")
for springs in ("stiff", "resolved"):
    found = []
    for dt in (0.02, 0.01, 0.005):
        work, spent = fall(time_step_s=dt, springs=springs)
        found.append((spent, abs(work / reference - 1)))
        print(f"{springs:9} dt = {1e3 * dt:4.0f} ms: {spent:5.2f} s, work of gravity off by {found[-1][1]:.2%}")
    axes.loglog(*np.array(found).T, "o-", label=f"{springs} springs, 20 / 10 / 5 ms")
axes.set(xlabel="processor time, s", ylabel="error of the work of gravity", title="a slope that slides")
axes.legend(frameon=False)

# %%
# The order of crack elements
# ---------------------------
# An inclined crack in a plate; the reference is order 10. Each additional order costs little and gains almost a digit.

rock = Material("rock", 17e9, 0.21, k_ic=2e6)
plate = np.array([[-0.03, -0.06], [0.03, -0.06], [0.03, 0.06], [-0.03, 0.06]])
crack = Cracks.from_polylines([np.array([[-5e-3, -5e-3], [5e-3, 5e-3]])], aperture=np.inf)
load = ddm.BodyLoad(sides={0: (0.0, 1e7), 2: (0.0, -1e7)})


def factors(order: int) -> tuple[np.ndarray, float]:
    began = clock.process_time()
    tips = ddm.Body([plate], crack, rock, DdmSettings(order=order)).solve(load).tips
    return np.array([tips["k_i"], tips["k_ii"]]), clock.process_time() - began


factors(4)
exact, _ = factors(10)
found = []
for order in (2, 3, 4, 5, 6, 8):
    k, spent = factors(order)
    found.append((1e3 * spent, np.abs(k - exact).max() / np.abs(exact).max()))
    print(f"order {order}: {found[-1][0]:5.1f} ms, K off by {found[-1][1]:.1e}")
figure, axes = plt.subplots(figsize=(5.5, 3.8), layout="constrained")
axes.loglog(*np.array(found).T, "s-", color="C2")
axes.set(xlabel="processor time, ms", ylabel="error of K", title="order 2 … 8 of elements")

# %%
# Or state the error that you accept: ``ddm.target_error`` in the scene, ``ddm.solve_to`` in Python.

solution = ddm.solve_to([plate], crack, rock, load, 1e-7)
left_over = np.abs(solution.tip_errors).max() / np.abs(solution.tips["k_ii"]).max()
print(f"asked for 1e-7: order {solution.body.settings.order}, estimated error {left_over:.1e}")

# %%
# The increment of growth
# -----------------------
# The same crack grows wing cracks 12 mm long, with increments of 4 to 1 mm. We compare the final positions of the tip.

ends, figure = {}, plt.figure(figsize=(5, 3.6), layout="constrained")
axes = figure.subplots()
for increment in (4e-3, 2e-3, 1e-3):
    steps = ddm.propagate(
        [plate],
        crack,
        rock,
        load,
        GrowthSettings(increment=increment),
        settings=DdmSettings(),
        control="toughness",
        max_steps=round(12e-3 / increment),
    )
    *_, last = steps
    nodes = last.cracks.nodes[last.cracks.segments]
    for a, b in nodes:
        axes.plot(*(1e3 * np.array([a, b])).T, color={4e-3: "C3", 2e-3: "C0", 1e-3: "k"}[increment], lw=1.2)
    ends[increment] = last.tips["point"][np.argmax(last.tips["point"][:, 1])]
    place = np.round(1e3 * ends[increment], 3)
    print(f"increment {1e3 * increment:.0f} mm: tip at {place} mm, load factor {last.load_factor:.3f}")
axes.set_aspect("equal")
axes.set(xlabel="mm", ylabel="mm", title="paths by increments of 4, 2 and 1 mm")

# %%
# Rules of thumb are given in :doc:`/howto/settings`, and error against run time for many problems, for this solver and
# others, in :doc:`/verification/speed`.
