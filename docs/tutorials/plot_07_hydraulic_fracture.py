"""
A hydraulic fracture beside a fault
===================================

A crack is pumped up in rock under in-situ stress. A fault, closed and rough, lies beside it. Does the fracture slip the fault,
and does the fault turn the fracture?
"""

# %%
# The crack solver alone: infinite plane, remote stress, fluid in one crack, friction on the other. No scene is needed.

import matplotlib.pyplot as plt
import numpy as np

from geomech import ddm
from geomech.model import Cracks, DdmSettings, GrowthSettings, JointLaw, Material

rock = Material("rock", 30e9, 0.22, k_ic=1.2e6)
fracture = np.array([[-2.0, 0.0], [2.0, 0.0]])
fault = np.array([[4.5, -3.0], [7.5, 5.0]])
cracks = Cracks.from_polylines([fracture, fault])
rough = JointLaw("fault", friction_angle=np.radians(32))
smooth = JointLaw("fracture", friction_angle=np.radians(30))

# %%
# In-situ stress: 10 MPa from above, 14 MPa from the side (tension is positive). The fracture opens against the smaller one once the fluid passes
# 10 MPa. The fault under it bears a shear of less than its friction: it is at rest.

stress = np.array([-14e6, -10e6, 0.0])
along = (fault[1] - fault[0]) / np.linalg.norm(fault[1] - fault[0])
across = np.array([-along[1], along[0]])
tensor = np.array([[stress[0], stress[2]], [stress[2], stress[1]]])
normal, shear = across @ tensor @ across, along @ tensor @ across
print(f"on the fault: {normal / 1e6:.2f} MPa across, {shear / 1e6:.2f} MPa along; friction holds {-normal / 1e6 * np.tan(np.radians(32)):.2f}")

# %%
# Pumped, not grown
# -----------------
# ``crack_pressure`` takes one value a segment, or a function of place: here the first segment alone has fluid. ``tip_errors`` says how far K can be trusted.


def load(pressure: float) -> ddm.BodyLoad:
    return ddm.BodyLoad(remote_stress=stress, crack_pressure=np.array([pressure, 0.0]))


settings = DdmSettings(order=6)
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
for pressure in (10.2e6, 10.6e6, 11e6):
    solution = ddm.Body([], cracks, rock, settings, face_laws=[smooth, rough]).solve(load(pressure))
    faces = solution.faces
    own = faces.segment == 1
    place = np.linalg.norm(faces.points[own].reshape(-1, 2) - fault[0], axis=1)
    order = np.argsort(place)
    left.plot(place[order], 1e6 * faces.slip[own].ravel()[order], label=f"{pressure / 1e6:.1f} MPa")
left.set(xlabel="along the fault, m", ylabel="slip, µm")
left.legend(frameon=False, title="fluid")
exact = (pressure + stress[1]) * np.sqrt(np.pi * 2.0)
print(f"K_I of the fracture {np.round(solution.tips['k_i'][:2] / 1e6, 4)} MPa √m (alone: {exact / 1e6:.4f}), errors {solution.tip_errors[:2, 0]}")

# %%
# The stress field shows why: the fracture presses the rock beside it, and unloads the fault ahead of its tip.

x, y = np.meshgrid(np.linspace(-4, 9, 120), np.linspace(-4, 6, 100))
field = solution.stress(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 3)
shades = right.pcolormesh(x, y, np.clip(field[..., 1] / 1e6, -12, -8), cmap="RdBu_r", shading="auto")
for line in (fracture, fault):
    right.plot(*line.T, color="k", lw=2)
right.set_aspect("equal")
figure.colorbar(shades, ax=right, label="σyy, MPa")

# %%
# It grows
# --------
# ``control="toughness"`` finds, step by step, the pressure that just drives the fracture: the fluid's excess over the rock's stress falls as it grows.
# Loads scale together here, so we pump with the excess alone and take the in-situ stress as what the fault is pressed by.

growth = GrowthSettings(increment=0.4)
steps = list(
    ddm.propagate([], Cracks.from_polylines([fracture]), rock, ddm.BodyLoad(crack_pressure=1e6), growth, settings, control="toughness", max_steps=6)
)
for step in steps:
    length = step.cracks.lengths.sum()
    exact = 1.2e6 / np.sqrt(np.pi * length / 2)
    print(f"length {length:4.1f} m: excess {step.load_factor:.4f} MPa, closed form {exact / 1e6:.4f}")

# %%
# ``pipelines/pressurised_crack`` grows a fracture to a free surface; scenes take fluids too (``[[loads.fluids]]``), pumped into cracks by name, standing in what they connect with.
