"""Scenes whose joint sets are drawn once and written as polylines, so that the same joints can be mirrored, rotated,
shifted and reordered.

A scene is the table of its TOML file. An isometry x → M x + s maps points to M x + s, vectors to M v and in-situ stress
σ to M σ Mᵀ.
"""

from __future__ import annotations

import copy
import math
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...model import Problem
from ...shapes.assembly import TOLERANCE

Scene = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Isometry:
    """x → ``matrix`` x + ``shift``: ``matrix`` (2, 2) orthogonal, ``shift`` (2,) m."""

    matrix: np.ndarray = field(default_factory=lambda: np.eye(2))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def mirrored(cls) -> Isometry:
        """About the y axis."""
        return cls(np.diag([-1.0, 1.0]))

    @classmethod
    def rotated(cls, angle: float) -> Isometry:
        """About the origin by ``angle``, rad, counter-clockwise."""
        c, s = math.cos(angle), math.sin(angle)
        return cls(np.array([[c, -s], [s, c]]))

    @classmethod
    def shifted(cls, by: Sequence[float]) -> Isometry:
        return cls(shift=np.asarray(by, dtype=float))

    @property
    def keeps_depth(self) -> bool:
        """Whether the vertical direction is preserved."""
        return bool(np.array_equal(self.matrix[:, 1], [0.0, 1.0]))

    def points(self, points: Any) -> list:
        """Images of points, or of one point, of a scene."""
        return (np.asarray(points, dtype=float) @ self.matrix.T + self.shift).tolist()

    def vector(self, vector: Any) -> list:
        return (np.asarray(vector, dtype=float) @ self.matrix.T).tolist()

    def stress(self, stress: Sequence[float]) -> np.ndarray:
        """(xx, yy, xy), rotated."""
        xx, yy, xy = stress
        turned = self.matrix @ np.array([[xx, xy], [xy, yy]]) @ self.matrix.T
        return np.array([turned[0, 0], turned[1, 1], turned[0, 1]])

    def back(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) original points."""
        return (points - self.shift) @ self.matrix


def drawn(text: str) -> Scene:
    """The scene of a TOML ``text`` with the traces of its joint sets as [[geometry.joints]], and the cutting tolerance
    in metres. Raises SceneError for an invalid scene."""
    scene = tomllib.loads(text)
    with tempfile.TemporaryDirectory() as folder:
        loaded = _load(scene, Path(folder))
    geometry = scene["geometry"]
    geometry.pop("joint_sets", None)
    geometry["joints"] = [
        {"name": joint.name.removeprefix("joint:"), "points": np.asarray(line, dtype=float).tolist()}
        for joint in (loaded.drawing.jointed.joints if loaded.drawing.jointed is not None else ())
        for line in joint.lines
    ]
    outlines = np.concatenate([np.asarray(zone["polygon"], dtype=float) for zone in geometry["zones"]])
    geometry.setdefault("tolerance_m", TOLERANCE * float(np.ptp(outlines, axis=0).max()))
    return scene


def moved(scene: Scene, by: Isometry) -> Scene:
    """``scene`` mapped by an isometry: outlines, joints, named edges, monitors, gravity, water, bolts, base motion and
    in-situ stress.

    Raises ValueError for rotated water, whose pressure increases with depth along y, and for tables that these scenes
    do not have.
    """
    unknown = set(scene.get("loads", {})) - {"gravity_m_s2", "gravity_ramp_s", "water", "bolts", "base", "in_situ"}
    unknown |= set(scene["geometry"]) & {"model", "cracks", "traces", "joint_sets", "origin"}
    if unknown:
        raise ValueError(f"no isometry of {', '.join(sorted(unknown))} is known here")
    if not can_be_moved(scene, by):
        raise ValueError("water pressure increases with depth along y: a scene with water cannot be rotated")
    out = copy.deepcopy(scene)
    geometry, loads = out["geometry"], out.get("loads", {})
    for zone in geometry["zones"]:
        zone["polygon"] = by.points(zone["polygon"])
    for joint in geometry.get("joints", ()):
        joint["points"] = by.points(joint["points"])
    for edge in geometry.get("edges", ()):
        edge["line"] = by.points(edge["line"])
    for monitor in out.get("monitors", ()):
        monitor["at"] = by.points(monitor["at"])
    for bolt in loads.get("bolts", ()):
        bolt.update((end, by.points(bolt[end])) for end in ("start", "end"))
    if "gravity_m_s2" in loads:
        loads["gravity_m_s2"] = by.vector(loads["gravity_m_s2"])
    if "base" in loads:
        loads["base"]["acceleration_m_s2"] = by.vector(loads["base"]["acceleration_m_s2"])
    if "water" in loads:
        loads["water"]["points"] = sorted(by.points(loads["water"]["points"]))
    if "in_situ" in loads:
        loads["in_situ"] = _in_situ(loads["in_situ"], by)
    return out


def can_be_moved(scene: Scene, by: Isometry) -> bool:
    """Whether a scene can be mapped: water stays level."""
    return "water" not in scene.get("loads", {}) or by.keeps_depth


def reordered(scene: Scene, rng: np.random.Generator) -> Scene:
    """``scene`` with its joints in another order, and each drawn from its other end."""
    out = copy.deepcopy(scene)
    joints = out["geometry"]["joints"]
    out["geometry"]["joints"] = [
        {"name": joints[k]["name"], "points": joints[k]["points"][::-1]} for k in rng.permutation(len(joints))
    ]
    return out


def frictionless(scene: Scene, time_step: float) -> Scene:
    """``scene`` in motion from rest under its weight by ``time_step`` s, with joints and cracks without strength."""
    out = copy.deepcopy(scene)
    for law in out.get("joints", {}).values():
        kept = {key: law[key] for key in ("edges", "between") if key in law}
        law.clear()
        law.update(kept, friction_angle_deg=0.0)
    # Without friction there is neither rest under in-situ stress nor static equilibrium under growing weight.
    for key in ("in_situ", "gravity_ramp_s"):
        out["loads"].pop(key, None)
    out["dda"].pop("equilibrium", None)
    out["run"].pop("stepping", None)
    out["dda"].update(dynamic_factor=1.0, time_step_s=time_step)
    return out


def problem_of(scene: Scene) -> Problem:
    """The problem of a scene. Raises SceneError for an invalid one."""
    with tempfile.TemporaryDirectory() as folder:
        return _load(scene, Path(folder)).problem()


def _load(scene: Scene, folder: Path):
    import tomli_w

    from ...scene import load_scene

    path = folder / "slope.toml"
    path.write_text(tomli_w.dumps(scene), encoding="utf-8")
    return load_scene(path)


def _in_situ(table: Scene, by: Isometry) -> Scene:
    """σ' = M σ Mᵀ at x' = M x + s, as stress at a point and its gradients along the axes."""
    if "surface_m" in table:
        share = np.array([table["k0"], 1.0, 0.0])
        stress = -table.get("surcharge_pa", 0.0) * share
        along_x, along_y = np.zeros(3), table["unit_weight_n_per_m3"] * share
        about = (0.0, table["surface_m"])
    else:
        stress, about = np.array(table["stress_pa"]), table.get("about", (0.0, 0.0))
        along_x, along_y = (np.array(table.get(f"gradient_{x}_pa_per_m", (0.0, 0.0, 0.0))) for x in "xy")
    turned = by.stress(along_x), by.stress(along_y)
    new_x, new_y = (by.matrix[k, 0] * turned[0] + by.matrix[k, 1] * turned[1] for k in range(2))
    return {
        "stress_pa": by.stress(stress).tolist(), "about": by.points(about),
        "gradient_x_pa_per_m": new_x.tolist(), "gradient_y_pa_per_m": new_y.tolist(),
    }  # fmt: skip
