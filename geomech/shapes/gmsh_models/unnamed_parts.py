"""Parts of a Gmsh model that a run would ignore: unnamed curves inside the rock, points off its plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..parts import JOINT, Zone
from .model_curves import Curves
from .model_drawing import CRACK

#: A curve is inside the rock if its length there exceeds this part of the rock's size: chords are closer to their
#: curves.
_INSIDE = 1e-3


def lost_curves(gmsh, path: Path, curves: Curves, zones: list[Zone], known: set[int]) -> list[tuple[str, str]]:
    """One warning per zone for curves inside it that are neither its boundary nor cracks: probably cracks without a
    name, which a run would ignore."""
    outlines = {abs(tag) for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(2), combined=False)}
    import shapely

    # Without a rim of the width of the chord tolerance: curves along an outline are not inside.
    rock = shapely.buffer([shapely.Polygon(zone.loops[0], zone.loops[1:]) for zone in zones], -2 * curves.chord)
    size = max(max(np.ptp(zone.loops[0], axis=0)) for zone in zones)
    inside: dict[str, list[int]] = {}
    for _, tag in gmsh.model.getEntities(1):
        if tag in known or tag in outlines:
            continue
        # The zone that contains most of it, wherever the curve's midpoint lies.
        shares = shapely.length(shapely.intersection(rock, shapely.linestrings(curves.polyline(tag)[0])))
        if shares.max() > _INSIDE * size:
            inside.setdefault(zones[int(np.argmax(shares))].name, []).append(tag)
    warnings = []
    for name, tags in inside.items():
        listed = ", ".join(map(str, tags))
        what = f"curves {listed} lie" if len(tags) > 1 else f"curve {listed} lies"
        message = (
            f"{path.name}: {what} inside zone {name!r} and {'are not cracks' if len(tags) > 1 else 'is not a crack'}"
        )
        way_out = (
            f'name a crack Physical Curve("{CRACK}NAME") = {{{listed}}}, a joint "{JOINT}NAME"; delete what only '
            "helped to draw"
        )
        warnings.append((message, way_out))
    return warnings


def out_of_plane(gmsh, path: Path, size: float) -> list[tuple[str, str]]:
    """A warning if points are off the plane z = 0 by more than round-off of a model of this ``size`` (m)."""
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
            "the model is plane and z is ignored: draw in x and y, with z = 0",
        )
    ]
