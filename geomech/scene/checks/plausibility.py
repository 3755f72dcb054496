"""Plausibility checks: values that are possible but probably mistakes, such as wrong units or crack ends that just miss
a surface."""

from __future__ import annotations

import numpy as np

from ...conventions import outward_normal_of
from ...model import counted
from ...model.blocks.corners import LARGEST_SHARE, corner_lengths
from ...model.blocks.polygon import distance_to_edges
from ...model.cracks.curved_tips import ERRORS, tip_deviations
from ...shapes.block_cutting.rock_outline import ground_of
from ..assembly.fixed_blocks import constrained_unknowns, fixed_blocks
from ..assembly.load_functions import traction_history
from ..tables import SceneTables
from ..tables.loads import TractionTable
from .check import Check
from .cross_checks import material_of
from .higher_order import check_holes

#: A crack end that misses an outline by less than this part of its crack's length was probably meant to reach it.
NEAR_MISS = 0.01
#: Largest plausible sides of cracked specimens and of outcrops, m.
SIZES = 1e-3, 100.0
#: Least plausible modulus (Pa) and toughness (Pa √m): rocks are stiffer and tougher by orders of magnitude; smaller
#: numbers are in GPa or MPa.
LEAST_MODULUS, LEAST_TOUGHNESS = 1e6, 1e3
#: Least plausible density, below that of the lightest pumice, kg/m³; smaller numbers (except 0) are in g/cm³ or t/m³.
LEAST_DENSITY = 100.0
#: Ratio of side length to block depth above which a cracked block with linear contact pressure is reported. The true pressure
#: concentrates below the load. On a rigid base K is off by 2 % at a ratio of 1, and too large by a factor of 1.4 at 1½, 2 at 2,
#: 5 at 3 (`tests/coupling/test_bases.py`); on a block of the same rock by 1.3 at 2, 2.2 at 3.
SHALLOW = 1.5
#: A side lies on another one if their distance is below this part of its length, over at least that part of it.
LIES_ON, MOST_OF_IT = 1e-6, 0.5
#: A moving block is a sliver next to one this many times as large by area: in motion, pairs of such blocks shorten
#: steps (`dda.step_control.relative_motion`) to less than a third of those of the large one.
SLIVER = 1e-2
#: A section is a slope if the ground at one end is higher than at the other by this part of its height; its back is
#: free if that much of the higher side is.
SLOPES = 0.25
#: Deviation of a curved crack's last chord from its curve, rad, above which its error of K is reported (3 % of K_II).
COARSE_CHORDS = 0.02
#: Largest plausible elastic strain: rock fails at strains of 0.1 to 1 %, and elements and blocks here are linear
#: elastic.
LARGEST_STRAIN = 0.05


def check_plausible(c: Check) -> None:
    """Warn of probable mistakes in units or drawing, for scenes without faults."""
    _materials(c)
    _size(c)
    _near_misses(c)
    _chords(c)
    _strain(c)
    _gravity(c)
    _weightless(c)
    _sudden_weight(c)
    _shallow(c)
    check_holes(c)
    _increment(c)
    _slivers(c)
    _rounding(c)
    _free_back(c)
    _impacts(c)


def _materials(c: Check) -> None:
    for name, m in c.tables.materials.items():
        if m.youngs_modulus_pa < LEAST_MODULUS:
            c.warn(
                ("materials", name, "youngs_modulus_pa"),
                f"Young's modulus of {name!r} is {m.youngs_modulus_pa:g} Pa, less than that of soft rubber",
                "the unit is Pa: 50 GPa is 50e9",
            )
        if m.k_ic_pa_sqrt_m is not None and m.k_ic_pa_sqrt_m < LEAST_TOUGHNESS:
            c.warn(
                ("materials", name, "k_ic_pa_sqrt_m"),
                f"the fracture toughness of {name!r} is {m.k_ic_pa_sqrt_m:g} Pa √m, far below that of any rock",
                "the unit is Pa √m: 1.2 MPa √m is 1.2e6",
            )
    # One light material among others of normal weight is intended: walls that only guide.
    name, heaviest = max(c.tables.materials.items(), key=lambda item: item[1].density_kg_m3)
    if 0 < heaviest.density_kg_m3 < LEAST_DENSITY:
        c.warn(
            ("materials", name, "density_kg_m3"),
            f"the density of {name!r} is {heaviest.density_kg_m3:g} kg/m³, less than that of any rock",
            "the unit is kg/m³: 2.6 t/m³ is 2600",
        )


def _slivers(c: Check) -> None:
    """Small blocks next to large ones, which shorten the steps of a dynamic run."""
    blocks = c.blocks
    if c.tables.dda.dynamic_factor == 0 or blocks.n_blocks < 3:
        return
    areas = blocks.areas()
    free = ~fixed_blocks(c.tables, c.drawn)
    if not free.any():
        return
    usual = float(np.median(areas[free]))
    slivers = np.flatnonzero(free & (areas < SLIVER * usual))
    if not len(slivers):
        return
    least = int(slivers[np.argmin(areas[slivers])])
    x, y = blocks.mean_vertices(blocks.vertices)[least]
    more = len(slivers) - 1
    others = f", and {more} more {'is' if more == 1 else 'are'} below {SLIVER * usual:.2g} m²" if more else ""
    c.warn(
        ("geometry",),
        f"{blocks.names[least]!r} near x = {x:.4g}, y = {y:.4g} m has {areas[least]:.2g} m², where half of the blocks have "
        f"more than {usual:.2g} m²{others}: where such slivers move fast, they shorten the time step",
        f"merge them with their neighbours: geometry.smallest_block_m2 = {SLIVER * usual:.1g}",
    )


def _rounding(c: Check) -> None:
    """A specified rounding length for which the edges at corners are too short."""
    if "corner_rounding" not in c.tables.dda.model_fields_set:
        return
    blocks, share = c.blocks, c.tables.dda.corner_rounding
    rounding, longest = corner_lengths(blocks, share)
    short = np.flatnonzero(longest < rounding)
    if not len(short):
        return
    worst = int(short[np.argmin(longest[short] / rounding[short])])
    x, y = blocks.vertices[worst]
    c.warn(
        ("dda", "corner_rounding"),
        f"{len(short)} of {len(rounding)} corners have edges too short for a rounding length of {share:g} √area and "
        f"are rounded less: that of {blocks.names[int(blocks.vertex_block[worst])]!r} at x = {x:.4g}, y = {y:.4g} m "
        f"over {longest[worst]:.2g} m instead of {rounding[worst]:.2g} m",
        f"a corner is rounded over at most {LARGEST_SHARE:g} of its shorter edge",
    )


def _free_back(c: Check) -> None:
    """A slope without rock behind it: blocks can leave it at the back as well as at the face."""
    blocks, t = c.blocks, c.tables
    fixed = fixed_blocks(t, c.drawn)
    if not any(t.loads.gravity_m_s2) or blocks.n_blocks < 3 or not fixed.any() or fixed.all():
        return
    ground, low = ground_of(blocks), float(blocks.vertices[:, 1].min())
    rise = float(ground[0, 1] - ground[-1, 1])
    if abs(rise) < SLOPES * (ground[:, 1].max() - low):
        return
    side = 0 if rise > 0 else -1
    x = float(ground[side, 0])
    starts, ends = blocks.vertices, blocks.vertices[blocks.next_vertex]
    loaded = {load.edge for load in t.loads.tractions} | {edge.edge for edge in t.loads.viscous_boundaries}
    constrained = constrained_unknowns(t, c.drawn)
    free = ~fixed if constrained is None else ~fixed & ~constrained.any(axis=1)
    near = 1e-6 * float(np.ptp(blocks.vertices, axis=0).max())
    on = free[blocks.vertex_block] & (np.abs(starts[:, 0] - x) < near) & (np.abs(ends[:, 0] - x) < near)
    on &= ~np.isin(blocks.edge_name, [k for k, name in enumerate(blocks.edge_names) if name in loaded])
    height = float(np.abs(ends[on, 1] - starts[on, 1]).sum())
    if height < SLOPES * abs(rise):
        return
    count = len(np.unique(blocks.vertex_block[on]))
    x += c.drawn.origin[0]
    c.warn(
        ("geometry",),
        f"nothing supports the back of the slope: {counted(count, 'block')} that may move {'is' if count == 1 else 'are'} free "
        f"at x = {x:.6g} m over {height:.3g} m, and can move out of the model there",
        'draw fixed rock behind it ([zones.NAME] fixed = true), or call those edges "guided:y" or "fixed"',
    )


def _gravity(c: Check) -> None:
    """Gravity that points upwards."""
    loads, place = c.tables.loads, ("loads", "gravity_m_s2")
    if not any(loads.gravity_m_s2):
        return
    if loads.gravity_m_s2[1] > 0:
        c.warn(place, "gravity points upwards", "y runs up: the weight of rock is gravity_m_s2 = [0, -9.81]")


def _increment(c: Check) -> None:
    """Growth increments that exceed a block's size give no path."""
    increment, blocks = c.tables.growth.increment_m, c.blocks
    if increment is None:
        return
    for b in np.unique(c.cracks.block).tolist():
        own = blocks.vertices[blocks.vertex_start[b] : blocks.vertex_start[b + 1]]
        largest = float(np.ptp(own, axis=0).max())
        if increment > largest:
            c.warn(
                ("growth", "increment_m"),
                f"an advance of {increment:g} m is longer than {blocks.names[b]!r}, which measures {largest:.3g} m: a "
                "tip crosses it in one step",
                "is it in metres? If it is left out, it is a tenth of the median crack",
            )
            return


def _weightless(c: Check) -> None:
    loads = c.tables.loads
    if loads.in_situ is not None and loads.gravity_ramp_s > 0:
        c.warn(
            ("loads", "gravity_ramp_s"),
            "blocks take their in-situ stress at time 0, when gravity is still 0: nothing balances it, and weight is "
            "applied afterwards",
            "leave `gravity_ramp_s` out",
        )


def _sudden_weight(c: Check) -> None:
    """Rock bridges that carry all the weight, in dynamics up to twice that, in the first steps."""
    t = c.tables
    loads, bridges = t.loads, len(c.cracks.names) - len(t.geometry.cracks)
    no_growth = all(m.k_ic_pa_sqrt_m is None for m in t.materials.values()) or not t.growth.enabled
    applied_gradually = loads.gravity_ramp_s > 0 or loads.in_situ is not None or t.dda.equilibrium
    if t.geometry.dead_ends != "cracks" or not t.geometry.joint_sets or bridges <= 0 or no_growth or applied_gradually:
        return
    if any(loads.gravity_m_s2) and t.dda.dynamic_factor > 0:
        c.warn(
            ("geometry", "dead_ends") if "dead_ends" in c.data["geometry"] else ("loads", "gravity_m_s2"),
            f"all weight is applied at once, and rock bridges in front of {bridges} cracks carry up to twice as much: "
            "blocks may split in the first steps that would be stable",
            'apply it gradually (loads.gravity_ramp_s), begin at rest (dda.equilibrium = "start"), or under the '
            "stress of the "
            "ground (loads.in_situ)",
        )


def _shallow(c: Check) -> None:
    """Linear contact pressure below wide cracked blocks of first order: on blocks that deform, on all if it was asked for."""
    if not c.cracks.n_segments:
        return
    moving = c.tables.dda.dynamic_factor > 0
    asked_for = c.tables.run.boundary_stress not in ("auto", "bases")
    found = _wide_sides(c, on_fixed=asked_for)
    if not found:
        return
    slenderness, block, length, on_fixed = max(found)
    others = f", and {len(found) - 1} more sides of cracked blocks" if len(found) > 1 else ""
    higher = f"give its zone{'' if on_fixed else ' and the one below'} an order of 7 (zones.NAME.order)"
    c.warn(
        ("run", "boundary_stress") if on_fixed else ("geometry",),
        f"{c.blocks.names[block]!r} contains cracks and lies on {'a fixed' if on_fixed else 'another'} block with a side of "
        f"{length:.3g} m, {slenderness:.2g} times as long as the block is deep{others}: its contact pressure is linear, which "
        f"bends it more than the true one would; K of its cracks{' at rest' if moving else ''} may be too large by a factor of two",
        'leave run.boundary_stress out, or set it to "bases"'
        if on_fixed
        else f"{higher}, or cut it by joints into pieces that are less than {SHALLOW:g} times as wide as deep",
    )


def _wide_sides(c: Check, on_fixed: bool) -> list[tuple[float, int, float, bool]]:
    """(length over depth, block, length in m, whether on a rigid base) of sides of cracked blocks of first order, longer than
    `SHALLOW` times their depth, that lie on blocks which deform or, with ``on_fixed``, on fixed, guided and rigid ones."""
    blocks, fixed = c.blocks, fixed_blocks(c.tables, c.drawn)
    zones, of = c.tables.zones, c.drawn.zones
    guided = constrained_unknowns(c.tables, c.drawn)
    straight = fixed | np.array([c.tables.materials[material_of(c.tables, zone)].rigid for zone in of], bool)
    straight = straight if guided is None else straight | guided.any(axis=1)
    # On these, blocks of higher order have the pressure of a rigid base.
    first = [of[b] not in zones or zones[of[b]].order == 1 for b in range(blocks.n_blocks)]
    cracked = {b for b in np.unique(c.cracks.block).tolist() if first[b] and not fixed[b]}
    weight, found = np.array(c.tables.loads.gravity_m_s2), []
    for start, side in blocks.sides.items():
        block = int(blocks.vertex_block[start])
        if block not in cracked:
            continue
        a, b = blocks.vertices[side[0]], blocks.vertices[side[-1]]
        length = float(np.hypot(*(b - a)))
        if weight.any() and weight @ outward_normal_of(b - a) < 0.5 * length * np.hypot(*weight):
            continue  # a wall at its side, not its base
        corners = blocks.vertices[blocks.vertex_start[block] : blocks.vertex_start[block + 1]] - a
        depth = np.abs((b - a)[0] * corners[:, 1] - (b - a)[1] * corners[:, 0]).max() / length
        slenderness = length / float(depth)
        # (A square is as wide as deep, whatever round-off says.)
        if slenderness <= (1 + LIES_ON) * SHALLOW:
            continue
        for rigid in (True, False) if on_fixed else (False,):
            base = np.flatnonzero((straight[blocks.vertex_block] == rigid) & (blocks.vertex_block != block))
            if _overlap(a, b, blocks.vertices[base], blocks.vertices[blocks.next_vertex[base]]) > MOST_OF_IT * length:
                found.append((slenderness, block, length, rigid))
    return found


def _overlap(a: np.ndarray, b: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> float:
    """Length (m) of the side from ``a`` to ``b`` on which edges from ``starts`` to ``ends`` (n, 2) lie."""
    along = b - a
    length = float(np.hypot(*along))
    off = [np.abs(along[0] * (p[:, 1] - a[1]) - along[1] * (p[:, 0] - a[0])) / length for p in (starts, ends)]
    on = np.maximum(*off) < LIES_ON * length
    places = np.clip(np.stack([(p[on] - a) @ along / length for p in (starts, ends)]), 0.0, length)
    return float(np.abs(places[1] - places[0]).sum())


def _size(c: Check) -> None:
    low, high = c.blocks.vertices.min(axis=0), c.blocks.vertices.max(axis=0)
    size = (high - low).max()
    if c.cracks.n_segments and not SIZES[0] <= size <= SIZES[1]:
        c.warn(
            ("geometry",),
            f"the drawing is {high[0] - low[0]:g} × {high[1] - low[1]:g} m",
            "are all lengths in metres?",
        )


def _near_misses(c: Check) -> None:
    blocks, cracks = c.blocks, c.cracks
    length = np.bincount(cracks.crack, cracks.lengths) if cracks.n_segments else np.empty(0)
    owner = dict(zip(cracks.segments.ravel().tolist(), np.repeat(np.arange(cracks.n_segments), 2).tolist()))
    for tip in cracks.tips.tolist():
        crack, block = int(cracks.crack[owner[tip]]), int(cracks.block[owner[tip]])
        own = np.flatnonzero(blocks.vertex_block == block)
        gap = distance_to_edges(cracks.nodes[tip], blocks.vertices[own], blocks.vertices[blocks.next_vertex[own]])
        if gap < NEAR_MISS * length[crack]:
            x, y = cracks.nodes[tip]
            c.warn(
                c.drawn.path_of_crack(cracks.names[crack]),
                f"crack {cracks.names[crack]!r} ends at ({x:g}, {y:g}), {gap:.2g} m from the outline of "
                f"{blocks.names[block]!r}, without touching it",
                "end it on the outline if it reaches the surface; the bridge left is very thin",
            )


def _chords(c: Check) -> None:
    """Curved cracks drawn with so few chords that the direction of the last one matters."""
    cracks = c.cracks
    deviation = tip_deviations(cracks)
    coarse = np.flatnonzero(deviation > COARSE_CHORDS)
    if not len(coarse):
        return
    worst = int(coarse[np.argmax(deviation[coarse])])
    tip = int(cracks.tips[worst])
    crack = int(cracks.crack[np.flatnonzero((cracks.segments == tip).any(axis=1))[0]])
    x, y = cracks.nodes[tip]
    of_k_ii, of_k_i = (100 * each * deviation[worst] for each in ERRORS)
    more = f", and {counted(len(coarse) - 1, 'more tip')} likewise" if len(coarse) > 1 else ""
    c.warn(
        c.drawn.path_of_crack(cracks.names[crack]),
        f"crack {cracks.names[crack]!r} is a polygon whose last side, at ({x:g}, {y:g}), deviates by "
        f"{np.degrees(deviation[worst]):.2g}° from the curve through its points{more}: K_I there is uncertain by "
        f"{of_k_ii:.2g} % of K_II, K_II by {of_k_i:.2g} % of K_I",
        "draw curved cracks with shorter chords at their tips",
    )


def _strain(c: Check) -> None:
    t, blocks = c.tables, c.blocks
    concerned = set(c.cracks.block.tolist())
    worst, at = 0.0, 0
    for k, traction in enumerate(t.loads.tractions):
        concerned.update(blocks.vertex_block[blocks.edges_named(traction.edge)].tolist())
        stress = _largest(t, traction)
        worst, at = (stress, k) if stress > worst else (worst, at)
    if worst == 0.0:
        return
    names = {material_of(t, c.drawn.zones[block]) for block in concerned}
    softest = min(names, key=lambda name: t.materials[name].youngs_modulus_pa)
    modulus = t.materials[softest].youngs_modulus_pa
    if worst > LARGEST_STRAIN * modulus:
        c.warn(
            ("loads", "tractions", at),
            f"its {worst / 1e6:.4g} MPa would strain {softest!r} (E = {modulus / 1e9:.4g} GPa) by "
            f"{100 * worst / modulus:.3g} %, should the run reach it",
            "check the modulus, the load and the end of the run",
        )


def _largest(t: SceneTables, traction: TractionTable) -> float:
    """Largest magnitude of a traction during the run, Pa: its history is linear between its times and the end."""
    history, end = traction_history(traction), t.run.end_time_s
    return max(float(np.hypot(*history.at(time))) for time in (*history.times[history.times < end], end))


def _impacts(c: Check) -> None:
    """Impacts with a coefficient of restitution load no cracks."""
    t = c.tables
    laws = [name for name, joint in t.joints.items() if joint.restitution is not None]
    if not laws or t.dda.dynamic_factor == 0 or not t.growth.enabled:
        return
    fixed, names = fixed_blocks(t, c.drawn), c.drawn.zones
    cracked = [b for b in np.unique(c.cracks.block).tolist() if not fixed[b]]
    if cracked:
        others = f" and {counted(len(cracked) - 1, 'more block')}" if len(cracked) > 1 else ""
        c.warn(
            ("joints", laws[0], "restitution"),
            "impacts by a coefficient of restitution change velocities only: they load no cracks, and "
            f"{names[cracked[0]]!r}{others} will not break on landing",
            "leave restitution out where rocks should break, with time steps well below a millisecond",
        )
