"""
A hydraulic fracture beside a fault
===================================

Fluid opens a crack in rock under in-situ stress, close to a closed fault with friction. Does the fracture make the
fault slip, and does the fault deflect the fracture?
"""

# %%
# This uses the crack solver alone: an infinite plane, far-field stress, fluid in one crack, friction on the other. No
# scene is needed.

import matplotlib.pyplot as plt
import numpy as np

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, JointLaw, Material

rock = Material("rock", 30e9, 0.22, k_ic=1.2e6)
fracture = np.array([[-2.0, 0.0], [2.0, 0.0]])
fault = np.array([[3.0, -1.4], [7.4, 3.0]])
cracks = Cracks.from_polylines([fracture, fault], names=["fracture", "fault"], law=[0, 1])
laws = [JointLaw("fracture", friction_angle=np.radians(30)), JointLaw("fault", friction_angle=np.radians(21))]
settings, growth = DdmSettings(order=4, elements_per_crack=8), GrowthSettings(increment=0.4)

# %%
# The in-situ compressive stress is 10 MPa vertically and 22 MPa horizontally (in the code, tension is positive). The
# fracture opens against the smaller one once the fluid pressure exceeds 10 MPa. The fault at 45° carries almost the
# shear stress that friction allows: it is only just stable.

stress = np.array([-22e6, -10e6, 0.0])
along = (fault[1] - fault[0]) / np.linalg.norm(fault[1] - fault[0])
across = np.array([-along[1], along[0]])
tensor = np.array([[stress[0], stress[2]], [stress[2], stress[1]]])
normal, shear = across @ tensor @ across, along @ tensor @ across
strength = -normal * np.tan(np.radians(21))
print(f"on the fault, MPa: {normal / 1e6:.2f} across, {shear / 1e6:.2f} along; friction resists {strength / 1e6:.2f}")

# %%
# Pressure without growth
# -----------------------
# A load consists of the far-field stress, which stays constant, and the fluid pressure in the segments of the first
# crack.


def load(pressure: float, cracks: Cracks = cracks) -> ddm.BodyLoad:
    """``pressure`` in MPa."""
    return ddm.BodyLoad(remote_stress=stress, crack_pressure=np.where(cracks.crack == 0, 1e6 * pressure, 0.0))


figure, left = plt.subplots(figsize=(5.5, 3.4), layout="constrained")
body = ddm.Body([], cracks, rock, settings, face_laws=laws)
for pressure in (10.2, 10.6, 11.0):
    solution = body.solve(load(pressure))
    faces = solution.faces
    own = faces.segment == 1
    place = np.linalg.norm(faces.points[own].reshape(-1, 2) - fault[0], axis=1)
    left.plot(np.sort(place), 1e6 * faces.slip[own].ravel()[np.argsort(place)], label=f"{pressure:.1f} MPa")
left.set(xlabel="along the fault, m", ylabel="slip, µm")
left.legend(frameon=False, title="fluid")
alone = (1e6 * pressure + stress[1]) * np.sqrt(np.pi * 2.0)
print(
    "K_I of the fracture's tips",
    np.round(solution.tips["k_i"][:2] / 1e6, 4),
    f"MPa √m; without the fault {alone / 1e6:.4f}",
)
print("estimated errors", np.round(solution.tip_errors[:2, 0] / alone, 9), "of it")

# %%
# The stress field shows why: the fluid pressure compresses the rock above and below the fracture, and reduces the
# compression of the fault ahead of the tip.

x, y = np.meshgrid(np.linspace(-4, 9, 130), np.linspace(-4, 5, 90))
field = solution.stress(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 3)
figure, right = plt.subplots(figsize=(6.5, 4), layout="constrained")
shades = right.pcolormesh(x, y, np.clip(field[..., 1] / 1e6, -12, -8), cmap="RdBu_r", shading="auto")
for line in (fracture, fault):
    right.plot(*line.T, color="k", lw=2)
right.set_aspect("equal")
figure.colorbar(shades, ax=right, label="σyy, MPa")

# %%
# Growth
# ------
# ``control="toughness"`` finds in each step the pressure at which the fracture just grows. Because the load is given as
# a function of the load factor, the stress in the rock stays constant while the fluid pressure changes.


def grow(network: Cracks, **options) -> list:
    """Eight steps, each at the pressure at which the most heavily loaded tip just grows."""
    return list(
        ddm.propagate([], network, rock, load, growth, settings=settings, control="toughness", max_steps=8, **options)
    )


with_fault = grow(cracks, face_laws=laws)
without_fault = grow(Cracks.from_polylines([fracture]))
print("length, m   pressure, MPa: beside the fault, alone, closed form for a straight crack")
for coupled, single in zip(with_fault, without_fault):
    length = single.cracks.lengths.sum()
    exact = 10 + 1.2 / np.sqrt(np.pi * length / 2)
    print(f"{length:6.1f}      {coupled.load_factor:8.4f}  {single.load_factor:8.4f}  {exact:8.4f}")

figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
for steps, colour, label in ((with_fault, "#d7263d", "beside the fault"), (without_fault, "0.6", "alone")):
    network = steps[-1].cracks
    for k, segment in enumerate(network.segments[network.crack == 0]):
        axes.plot(*network.nodes[segment].T, color=colour, lw=2, label=label if k == 0 else None)
axes.plot(*fault.T, color="k", lw=2, label="fault")
axes.set_aspect("equal")
axes.set(xlabel="x, m", ylabel="y, m")
axes.legend(frameon=False)
for step in with_fault:
    for event in step.events:
        print(event.kind, event.detail, np.round(event.point, 2))

# %%
# ``pipelines/pressurised_crack`` grows a fracture to a free surface. Scenes can contain fluids too (``[[loads.fluids]]``),
# in the cracks that you name and in all cracks connected with them.
