"""What a Gmsh model draws and a run would know nothing of: nameless curves inside the rock, heights off its plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .gmsh_curves import Curves
from .gmsh_drawing import CRACK
from .parts import JOINT, Zone


def lost_curves(gmsh, path: Path, curves: Curves, zones: list[Zone], known: set[int]) -> list[tuple[str, str]]:
    """A warning a zone for curves drawn inside it that are neither its boundary nor cracks: most likely cracks that
    were not named, of which the run would know nothing."""
    outlines = {abs(tag) for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(2), combined=False)}
    inside: dict[str, list[int]] = {}
    for _, tag in gmsh.model.getEntities(1):
        if tag in known or tag in outlines:
            continue
        points = curves.polyline(tag)[0]
        middles = 0.5 * (points[1:] + points[:-1])
        zone = next((zone for zone in zones if any(_holds(zone, middle) for middle in middles)), None)
        if zone is not None:
            inside.setdefault(zone.name, []).append(tag)
    warnings = []
    for name, tags in inside.items():
        listed = ", ".join(map(str, tags))
        what = f"curves {listed} lie" if len(tags) > 1 else f"curve {listed} lies"
        message = f"{path.name}: {what} inside zone {name!r} and {'are no cracks' if len(tags) > 1 else 'is no crack'}"
        way_out = (
            f'name a crack Physical Curve("{CRACK}NAME") = {{{listed}}}, a joint "{JOINT}NAME"; delete what only '
            "helped to draw"
        )
        warnings.append((message, way_out))
    return warnings


def _holds(zone: Zone, point: np.ndarray) -> bool:
    """Whether ``point`` is inside the outline and outside the holes: a ray from it crosses the loops an odd number of
    times."""
    crossings = 0
    for loop in zone.loops:
        a, b = loop, np.roll(loop, -1, axis=0)
        spans = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
        a, b = a[spans], b[spans]
        crossings += int((a[:, 0] + (point[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]) > point[0]).sum())
    return crossings % 2 == 1


def out_of_plane(gmsh, path: Path, size: float) -> list[tuple[str, str]]:
    """A warning where points stand off the plane z = 0 by more than round-off of a model of this ``size``, m."""
    z = {tag: gmsh.model.getValue(0, tag, [])[2] for _, tag in gmsh.model.getEntities(0)}
    off = [tag for tag, value in z.items() if abs(value) > 1e-9 * size]
    if not off:
        return []
    shown = ", ".join(map(str, off[:6])) + (", …" if len(off) > 6 else "")
    worst = max((z[tag] for tag in off), key=abs)
    return [
        (
            (
                f"{path.name}: {f'points {shown} have' if len(off) > 1 else f'point {shown} has'} z ≠ 0 (up to "
                f"{worst:g} m)"
            ),
            "the rock is plane and z is left away: draw in x and y, with z = 0",
        )
    ]
