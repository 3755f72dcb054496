"""Crack initiation in intact rock: at an outline, a hole, the face of another crack, or in the interior.

Intact rock fails where it reaches its strength. With principal stresses σ1 ≥ σ3 (in the plane, tension positive),
tensile strength T, cohesion c and friction angle φ, the stress over strength ("overstress") is

    in tension  σ1 / T                                        on the plane normal to σ1,
    in shear    [(σ1 − σ3) + (σ1 + σ3) sin φ] / (2 c cos φ)   on planes at ±(45° − φ/2) to the direction of σ3

(Mohr–Coulomb, without the out-of-plane stress): 1 at failure, and proportional to the load as long as stress is. The
larger of the two decides.

On a smooth surface the stress is finite, and the initiation load does not depend on elements and increment. At a
re-entrant corner it is singular, and a stress concentration smaller than the characteristic length of the rock does not
break it. The stress may therefore be averaged along the future crack from the surface inwards (Novozhilov 1969), over a
distance that is a property of the rock: `material_length` is the one with which a long crack fails at its K_Ic and a
smooth wall at its strength. Corners are considered only then. Zero, the default, uses the stress at the point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...conventions import normal_of, traction
from ...model import Cracks, GrowthSettings, Material
from ...model.former_names import renamed_exports
from ..kernels import shape_functions
from ..mesh.point_location import inside
from ..solution import Solution
from .crack_network import Network, Point, nearest_on
from .tie_tolerance import ONE_WAY, TIED, in_order, reached

#: Where cracks may start, by the names in scenes.
PLACES = ("", "surface", "everywhere")
#: Smallest angle between a new crack and its surface: below it, a skin thinner than any increment would peel off.
LEAST_ANGLE = math.radians(10.0)
#: Cracks whose overstress is within this fraction of the largest start together, for example symmetric ones.
TOGETHER = 1e-3
#: Default spacing of new cracks, and their distance from other cracks, in increments.
SPACING, APART = 5.0, 2.0
#: Clearance of a new crack from anything else, as a fraction of its length.
CLEARANCE = 0.2
#: Largest turn of a crack that does not count as a corner.
SMOOTH = math.radians(20.0)
#: A side of a polygon that turns by no more than this at both ends is part of a curve.
CURVE = math.radians(31.0)
#: Approximate largest number of grid points in the rock.
GRID = 4000
#: Distance from a crack face at which its stress is evaluated, as a fraction of the element length.
_BESIDE = 1e-6


@dataclass(frozen=True)
class NewCrack:
    """A new crack from ``start`` to ``end``. ``kind``: "tension" or "shear"; ``place``: "surface" (starts on an outline
    or hole), "face" (starts on ``segment`` of another crack) or "rock"; ``overstress``: 1 at failure."""

    kind: str
    place: str
    overstress: float
    start: Point
    end: Point
    segment: int = -1


def material_length(material: Material) -> float:
    """d = (2/π)(K_Ic/T)², m: the mean of K_Ic/√(2πr) over r < d is the tensile strength T (Novozhilov 1969; Seweryn
    1994)."""
    return 2 / math.pi * (material.k_ic / material.tensile_strength) ** 2


def overstress(stress: np.ndarray, material: Material) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tensile and shear overstress (n,) of ``stress`` (n, 3) and the angle (n,) of the direction of σ1, rad."""
    xx, yy, xy = np.moveaxis(np.asarray(stress, dtype=float), -1, 0)
    mean, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    tension = np.maximum(mean + radius, 0.0) / material.tensile_strength
    if math.isfinite(material.cohesion):
        phi = material.friction_angle
        shear = np.maximum(radius + mean * math.sin(phi), 0.0) / (material.cohesion * math.cos(phi))
    else:
        shear = np.zeros_like(radius)
    # Under equal stress on all sides every direction is principal.
    has_direction = radius > TIED * np.abs(mean)
    return tension, shear, np.where(has_direction, 0.5 * np.arctan2(2 * xy, xx - yy), 0.0)


def new_cracks(solution: Solution, material: Material, settings: GrowthSettings, block: int = 0) -> list[NewCrack]:
    """The new cracks that would start first under this load, by decreasing overstress, whether or not it reaches 1.

    ``settings.initiation``: where to search ("surface" includes crack faces). Each crack has the length
    settings.increment, keeps settings.initiation_spacing from tips, mouths, junctions and other new cracks, and crosses
    nothing. Those within 0.1 % of the first start with it. ``block``: number of the block in the body's cracks. [] if
    the rock has no finite strength or there is no room for a crack. Raises ValueError for an unknown place.
    """
    if settings.initiation not in PLACES:
        raise ValueError(f"initiation must be one of {PLACES[1:]}, got {settings.initiation!r}")
    if not settings.initiation or not (math.isfinite(material.tensile_strength) or math.isfinite(material.cohesion)):
        return []
    network = Network(solution.body.cracks, lambda block: solution.body.limits, 0)
    spacing = _spacing(settings)
    chosen: list[NewCrack] = []
    for birth in _candidates(solution, material, settings):
        if birth.overstress <= 0 or (chosen and birth.overstress < (1 - TOGETHER) * chosen[0].overstress):
            break
        apart = all(reached(math.dist(birth.start, other.start), spacing) for other in chosen)
        if apart and _has_room(network, birth, settings, block):
            chosen.append(birth)
    return chosen


def add_new_cracks(
    cracks: Cracks,
    loops_of: Callable[[int], Sequence[np.ndarray]],
    new: Sequence[NewCrack],
    cycle: int,
    block: int = 0,
) -> Cracks:
    """``cracks`` with the ``new`` cracks added, named "born 1", "born 2" …; their ``segment`` numbers refer to
    ``cracks``."""
    network = Network(cracks, loops_of, cycle)
    pieces = [[row] for row in network.rows]
    number = sum(name.startswith("born ") for name in cracks.names)
    for birth in new:
        number += 1
        start = network.add_node(birth.start, surface=birth.place == "surface")
        if birth.place == "face":
            parts = pieces[birth.segment]
            cut = min(
                parts, key=lambda row: nearest_on(birth.start, network.nodes[row.start], network.nodes[row.end])[0]
            )
            network.split(cut, start)
            parts.remove(cut)
            parts += network.rows_at(start)
        network.begin(f"born {number}", block, start, network.add_node(birth.end))
    return network.freeze()


def _spacing(settings: GrowthSettings) -> float:
    return settings.initiation_spacing or SPACING * settings.increment


# -- places ----------------------------------------------------------------------------------------------------------


def _candidates(solution: Solution, material: Material, settings: GrowthSettings) -> list[NewCrack]:
    """All possible new cracks, most overstressed first."""
    found: list[NewCrack] = []
    surfaces = [_on_curves(solution), _on_sides(solution), _on_faces(solution)]
    if solution.body.half_plane is not None:
        surfaces.append(_on_free_surface(solution, settings))
    if settings.initiation_distance > 0:
        surfaces.append(_at_corners(solution, settings.initiation_distance))
    for points, inward, segment, stress in surfaces:
        free = _away(solution.body.cracks, points, segment, settings)
        found += _from_surface(solution, material, settings, points[free], inward[free], segment[free], stress(free))
    if settings.initiation == "everywhere":
        found += _in_rock(solution, material, settings)
    most = max((b.overstress for b in found), default=0.0)
    return [found[k] for k in in_order([-b.overstress for b in found], TIED * most)]


# Each of the following returns points (n, 2) of surfaces, unit vectors into the rock, crack segments (−1 on outlines),
# and a function that gives the stress at selected points.


def _on_curves(solution: Solution):
    """Sides of polygons that represent curves, at their midpoints, with the mean stress over the side: accurate to 0.4
    % for a hole of 64 sides and 2.4 % for 24. At vertices the polygon's own stress concentration governs, and at
    midpoints stress is lower than on the curve."""
    body, g = solution.body, solution.body.boundary
    sides = np.flatnonzero(_sides_of_curves(body.loops))
    edge = body.mesh.edges[sides]
    along = (edge[:, 1] - edge[:, 0]) / np.hypot(*(edge[:, 1] - edge[:, 0]).T)[:, None]

    def stress(which: np.ndarray) -> np.ndarray:
        number = np.full(len(body.mesh.edges), -1)
        number[sides[which]] = np.arange(which.sum())
        here = np.flatnonzero(number[g.source] >= 0)
        at = solution.stress(g.nodes[here].reshape(-1, 2)).reshape(len(here), g.per, 3)
        ds = g.quadrature[here]
        total = np.zeros((int(which.sum()), 4))
        np.add.at(total, number[g.source[here]], np.column_stack([np.einsum("ek,ekc->ec", ds, at), ds.sum(axis=1)]))
        return total[:, :3] / total[:, 3:]

    return edge.mean(axis=1), normal_of(along), np.full(len(sides), -1), stress


def _on_sides(solution: Solution):
    """The other sides of outline and holes, at their collocation points; on corner elements only the central ones."""
    body, g = solution.body, solution.body.boundary
    edge = body.mesh.edges[g.source]
    t = shape_functions.nodes(g.family, g.order)
    at_corner = (g.start == edge[:, 0]).all(axis=1) | (g.end == edge[:, 1]).all(axis=1)
    used = ~at_corner[:, None] | (np.abs(t) == np.abs(t).min())[None]
    used &= ~_sides_of_curves(body.loops)[g.source, None]
    points, inward = g.nodes[used], np.broadcast_to(g.normal[:, None], g.nodes.shape)[used]
    return points, inward, np.full(len(points), -1), lambda which: solution.stress(points[which])


def _on_faces(solution: Solution):
    """Both faces of the cracks, at central points only: a new crack at the end of an increment would leave a sliver."""
    c = solution.body.faces
    t = shape_functions.nodes(c.family, c.order)
    central = np.flatnonzero(np.abs(t) <= max(0.5, np.abs(t).min()))
    points = np.tile(c.nodes[:, central].reshape(-1, 2), (2, 1))
    inward = np.concatenate([side * np.repeat(c.normal, len(central), axis=0) for side in (1.0, -1.0)])
    offset = np.tile(np.repeat(_BESIDE * c.length, len(central)), 2)[:, None] * inward
    segment = np.tile(np.repeat(c.source, len(central)), 2)
    return points, inward, segment, lambda which: solution.stress((points + offset)[which])


def _on_free_surface(solution: Solution, settings: GrowthSettings):
    """Evenly spaced points on the surface of a half-plane, up to one extent beyond the structure below it."""
    body, rock = solution.body, solution.body.half_plane
    assert rock is not None
    below = np.concatenate([*body.loops, body.cracks.nodes, np.empty((0, 2))])
    along = rock.frame(below)[:, 0] if len(below) else np.zeros(1)
    low, high = along.min() - body._extent, along.max() + body._extent
    n = min(GRID, math.ceil((1 - TIED) * (high - low) / _spacing(settings)))
    # An odd number, so that symmetric bodies have a point in the centre.
    x = low + (high - low) * (np.arange(2 * (n // 2) + 1) + 0.5) / (2 * (n // 2) + 1)
    points = np.asarray(rock.point) + x[:, None] * rock.turn[0]
    inward = np.broadcast_to(-np.asarray(rock.outward), points.shape)
    return points, inward, np.full(len(points), -1), lambda which: solution.stress(points[which])


def _at_corners(solution: Solution, distance: float):
    """Re-entrant corners of outline and holes. The stress is finite only away from them: halfway along the
    ``distance``."""
    sharp_corners, inward_at = [np.empty((0, 2))], [np.empty((0, 2))]
    for loop in solution.body.loops:
        heading, turn = _turns(loop)
        sharp = turn < -CURVE
        # The rock is on the left of both edges: direction of the mean of their normals.
        into = heading - 0.5 * turn + 0.5 * math.pi
        sharp_corners.append(loop[sharp])
        inward_at.append(np.column_stack([np.cos(into), np.sin(into)])[sharp])
    corners, inward = np.concatenate(sharp_corners), np.concatenate(inward_at)
    return (
        corners,
        inward,
        np.full(len(corners), -1),
        lambda which: solution.stress((corners + 0.5 * distance * inward)[which]),
    )


def _sides_of_curves(loops: Sequence[np.ndarray]) -> np.ndarray:
    """(n_edges,) bool: edges that turn by no more than `CURVE` into both neighbours."""
    slight = [np.abs(_turns(loop)[1]) <= CURVE for loop in loops]
    return np.concatenate([np.empty(0, bool), *(here & np.roll(here, -1) for here in slight)])


def _turns(loop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) heading of the edge that leaves each vertex, and the turn into it, rad; negative at re-entrant corners."""
    way = np.roll(loop, -1, axis=0) - loop
    heading = np.arctan2(way[:, 1], way[:, 0])
    return heading, np.mod(heading - np.roll(heading, 1) + math.pi, 2 * math.pi) - math.pi


def _away(cracks: Cracks, points: np.ndarray, own: np.ndarray, settings: GrowthSettings) -> np.ndarray:
    """(n,) bool: points far enough from tips, mouths, junctions and corners of cracks, where stress intensity governs,
    and, unless they lie on a face (``own`` ≥ 0), from all cracks."""
    free = np.ones(len(points), bool)
    if not cracks.n_segments:
        return free
    special = cracks.surface | (cracks.valence != 2)
    near = np.where(special, _spacing(settings), APART * settings.increment)
    marked = np.flatnonzero((special | _corners(cracks)) & (cracks.valence > 0))
    for node in marked:
        free &= reached(np.hypot(*(points - cracks.nodes[node]).T), near[node])
    start, along = cracks.nodes[cracks.segments[:, 0]], np.diff(cracks.nodes[cracks.segments], axis=1)[:, 0]
    for s in range(cracks.n_segments):
        rel = points - start[s]
        share = np.clip(rel @ along[s] / cracks.lengths[s] ** 2, 0, 1)
        distance = np.hypot(*(rel - share[:, None] * along[s]).T)
        free &= (own >= 0) | reached(distance, APART * settings.increment)
    return free


def _corners(cracks: Cracks) -> np.ndarray:
    """(n_nodes,) bool: nodes at which a crack turns by more than `SMOOTH`."""
    way = np.zeros((len(cracks.nodes), 2))
    along = np.diff(cracks.nodes[cracks.segments], axis=1)[:, 0] / cracks.lengths[:, None]
    np.add.at(way, cracks.segments[:, 0], along)
    np.add.at(way, cracks.segments[:, 1], -along)
    # Unit vectors from a node along two segments with a turn ω add up to 2 sin(ω/2).
    return (cracks.valence == 2) & (np.hypot(*way.T) > 2 * math.sin(SMOOTH / 2))


# -- directions ------------------------------------------------------------------------------------------------------


def _from_surface(solution, material, settings, points, inward, segment, stress) -> Iterator[NewCrack]:
    """Cracks from surface points into the rock, in the directions given by the ``stress`` there."""
    loops = solution.body.limits
    for kind, way in _ways(stress, material, inward):
        here = np.flatnonzero(np.isfinite(way[:, 0]))
        acting = stress[here]
        if settings.initiation_distance > 0:
            # Gauss points in the root of the distance, which resolve a rise as 1/√r towards a corner.
            t, weight = np.polynomial.legendre.leggauss(5)
            root = 0.5 * (1 + t)
            at = settings.initiation_distance * root**2
            inner = points[here, None] + at[None, :, None] * way[here, None]
            ok = inside(loops, inner.reshape(-1, 2)).reshape(len(here), len(t)).all(axis=1)
            here, inner = here[ok], inner[ok]
            acting = np.einsum("k,nkc->nc", weight * root, solution.stress(inner.reshape(-1, 2)).reshape(-1, len(t), 3))
        size = _on_plane(kind, acting, way[here], material)
        for row, value in zip(here.tolist(), size.tolist()):
            yield NewCrack(
                kind,
                "face" if segment[row] >= 0 else "surface",
                value,
                tuple(points[row].tolist()),
                tuple((points[row] + settings.increment * way[row]).tolist()),
                int(segment[row]),
            )


def _ways(stress: np.ndarray, material: Material, inward: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Kind and unit vectors (n, 2) along cracks into the rock; nan where there is none of that kind."""
    tension, shear, angle = overstress(stress, material)

    def into(theta: np.ndarray, ok: np.ndarray) -> np.ndarray:
        way = np.column_stack([np.cos(theta), np.sin(theta)])
        depth = np.sum(way * inward, axis=1)
        way *= np.where(depth < 0, -1.0, 1.0)[:, None]
        way[~ok | (np.abs(depth) < math.sin(LEAST_ANGLE))] = np.nan
        return way

    across = angle + math.pi / 2  # the direction of σ3, along which tensile cracks run
    tensile = reached(tension, shear)
    yield "tension", into(across, (tension > 0) & tensile)
    slant = math.pi / 4 - material.friction_angle / 2
    for turn in (slant, -slant):
        yield "shear", into(across + turn, ~tensile)


def _on_plane(kind: str, stress: np.ndarray, way: np.ndarray, material: Material) -> np.ndarray:
    """Overstress (n,) of ``stress`` (n, 3) on the planes of cracks along ``way`` (n, 2): σ_n/T, or (|τ| + σ_n tan φ)/c.
    At a point these planes are those of `overstress`; an averaged stress has other principal directions than the
    surface."""
    normal = normal_of(way)
    t = traction(stress, normal)
    pull = np.sum(t * normal, axis=1)
    if kind == "tension":
        return np.maximum(pull, 0.0) / material.tensile_strength
    shear_stress = np.abs(np.sum(t * way, axis=1))
    return np.maximum(shear_stress + pull * math.tan(material.friction_angle), 0.0) / material.cohesion


def _in_rock(solution, material, settings) -> Iterator[NewCrack]:
    """Cracks in the interior, with their midpoints on a grid."""
    body = solution.body
    corners = np.concatenate([*body.loops, body.cracks.nodes, np.empty((0, 2))])
    if not len(corners):
        return
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not body.outlined:
        low, high = low - 0.5 * (high - low).max(), high + 0.5 * (high - low).max()
    step = max(_spacing(settings), math.sqrt(float(np.prod(high - low)) / GRID))
    if not step < (high - low).max():
        return
    axes = [np.linspace(a, b, max(2, math.ceil((1 - TIED) * (b - a) / step)) + 1) for a, b in zip(low, high)]
    points = np.stack(np.meshgrid(*[0.5 * (x[1:] + x[:-1]) for x in axes]), axis=-1).reshape(-1, 2)
    points = points[inside(body.limits, points)]
    points = points[_away(body.cracks, points, np.full(len(points), -1), settings)]
    stress = solution.stress(points)
    tension, shear, angle = overstress(stress, material)
    tensile = reached(tension, shear)
    theta = angle + math.pi / 2 + np.where(tensile, 0.0, math.pi / 4 - material.friction_angle / 2)
    # The second end is the one to the right; of a vertical crack the upper one.
    quarter = math.pi / 2 - ONE_WAY
    theta = np.mod(theta + quarter, math.pi) - quarter
    half = 0.5 * settings.increment * np.column_stack([np.cos(theta), np.sin(theta)])
    for k in np.flatnonzero(np.maximum(tension, shear) > 0).tolist():
        value = float(max(tension[k], shear[k]))
        kind = "tension" if tensile[k] else "shear"
        yield NewCrack(
            kind, "rock", value, tuple((points[k] - half[k]).tolist()), tuple((points[k] + half[k]).tolist())
        )


def _has_room(network: Network, birth: NewCrack, settings: GrowthSettings, block: int) -> bool:
    """Whether the new crack touches nothing but the surface it starts from."""
    clearance = CLEARANCE * settings.increment
    start = network.add_node(birth.start, surface=birth.place == "surface")
    own = network.rows[birth.segment] if birth.place == "face" else None
    for obstacle in network.near(block, start, settings.increment + 2 * clearance):
        if obstacle.row is not None and obstacle.row is own:
            continue
        if network.first_contact(start, birth.start, birth.end, obstacle, clearance) is not None:
            return False
    return True


__getattr__ = renamed_exports(
    __name__, {"births": "new_cracks", "bear": "add_new_cracks", "Birth": "NewCrack"}, globals()
)
