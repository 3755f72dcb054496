"""Picture of `geomech build`: blocks with joint sets, cracks, rock bridges, supports and loads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geomech.model import Blocks, Problem
from geomech.model.loads.ground import lowest_over, ponds
from geomech.scene.assembly.load_functions import deepest_pond
from geomech.shapes.block_cutting.rock_outline import ground_of
from geomech.shapes.joint_networks.rock_bridges import rock_bridges
from geomech.shapes.parts import JOINT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours of joint sets in order: distinguishable with colour blindness (after Okabe & Ito 2008), and from the rock.
SETS = ("#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c564b", "#7f7f7f", "#b5bd00")
#: Colours of materials in order; fixed rock is grey in any case.
ROCKS = ("#efe6d5", "#dfe7e3", "#e8dce6", "#f3dfc9", "#dbe3ef")
FIXED, INK, CRACK, BRIDGE, LOAD, WATER = "#b9bcc2", "#33363b", "#d7263d", "#ff7a1a", "#5b2a86", "#2f80d0"


def draw_block_map(scene: Any, statistics: dict[str, Any], path: Path | str) -> Path:
    """Draw the blocks of a loaded scene, with the ``statistics`` of `geomech.output.block_model.block_system`, as a
    PNG."""
    from matplotlib.figure import Figure

    problem: Problem = scene.problem()
    blocks, cracks = problem.blocks, problem.cracks
    low, high = blocks.vertices.min(axis=0), blocks.vertices.max(axis=0)
    wide, tall = high - low
    size = float(max(wide, tall))
    # The drawing keeps its proportions inside 10 × 8 inches; the text is at its right.
    across = min(10.0, 7.2 * wide / tall)
    across, up = max(across, 3.2), max(min(across * tall / wide, 7.2), 2.6)
    figure = Figure(figsize=(across + 4.1, up + 1.3), dpi=130)
    axes = figure.add_axes((0.55 / (across + 4.1), 0.5 / (up + 1.3), across / (across + 4.1), up / (up + 1.3)))
    # Thinner lines if there are many blocks.
    thin = float(np.clip(2.2 / max(1.0, (blocks.n_blocks / 60) ** 0.35), 0.25, 2.2))
    keys: list[Any] = []
    edges = np.stack([blocks.vertices, blocks.vertices[blocks.next_vertex]], axis=1)
    keys += _draw_rock(axes, problem)
    keys += _draw_joints(axes, scene, blocks, statistics, thin)
    if cracks.n_segments:
        keys += _draw_cracks(axes, problem, thin, size)
    keys += _conditions(axes, scene, problem, edges, size)
    margin = 0.05 * size
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
    axes.tick_params(labelsize=8, colors=INK, length=3)
    x, y = scene.origin
    axes.set_xlabel(f"m from ({x:.10g}, {y:.10g})" if x or y else "m", fontsize=8, color=INK)
    for side in axes.spines.values():
        side.set_visible(False)
    left = (0.55 + across + 0.15) / (across + 4.1)
    figure.text(0.35 / (across + 4.1), 1 - 0.36 / (up + 1.3), problem.title, fontsize=13, color=INK, weight="bold")
    figure.text(0.35 / (across + 4.1), 1 - 0.6 / (up + 1.3), _caption(statistics), fontsize=9, color="#4a4e55")
    figure.legend(
        handles=keys, loc="upper left", bbox_to_anchor=(left, 1 - 0.72 / (up + 1.3)), frameon=False, fontsize=9,
        labelcolor=INK, handlelength=1.9,
    )  # fmt: skip
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, facecolor="white")
    return path


def _draw_rock(axes: Axes, problem: Problem) -> list[Any]:
    """Blocks in the colours of their rock; returns legend entries."""
    from matplotlib.collections import PathCollection
    from matplotlib.patches import Patch

    blocks = problem.blocks
    keys: list[Any] = []
    outlines = [_path(blocks.loops(b)) for b in range(blocks.n_blocks)]
    rng = np.random.default_rng(0)
    shade = rng.uniform(0.955, 1.0, blocks.n_blocks)[:, None] if blocks.n_blocks > 1 else np.ones((1, 1))
    fill = np.array([_rgb(ROCKS[m % len(ROCKS)]) for m in blocks.material])
    fill[blocks.fixed] = _rgb(FIXED)
    axes.add_collection(PathCollection(outlines, facecolors=fill * shade, edgecolors="none"))
    for m, material in enumerate(problem.materials):
        if (blocks.material[~blocks.fixed] == m).any():
            keys.append(Patch(facecolor=ROCKS[m % len(ROCKS)], edgecolor=INK, lw=0.5, label=material.name))
    if blocks.fixed.any():
        supports = [outline for outline, fixed in zip(outlines, blocks.fixed) if fixed]
        axes.add_collection(
            PathCollection(supports, facecolors="none", edgecolors="#8d9199", hatch="////", linewidths=0)
        )
        keys.append(Patch(facecolor=FIXED, edgecolor="#8d9199", hatch="////", label="fixed"))
    return keys


def _draw_joints(axes: Axes, scene: Any, blocks: Blocks, statistics: dict[str, Any], thin: float) -> list[Any]:
    """Outlines and joints with this line width; returns legend entries of the joint sets."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    keys: list[Any] = []
    edges = np.stack([blocks.vertices, blocks.vertices[blocks.next_vertex]], axis=1)
    colour = joint_colours(scene)
    joints = list(colour)
    plain = np.array([not name.startswith(JOINT) for name in blocks.edge_names])[blocks.edge_name]
    axes.add_collection(LineCollection(edges[plain], colors=INK, linewidths=max(0.6, 0.6 * thin), capstyle="round"))
    of_set = {JOINT + entry["name"]: entry for entry in statistics["sets"]}
    for name in joints:
        if name in blocks.edge_names:
            own = blocks.edge_name == blocks.edge_names.index(name)
            axes.add_collection(LineCollection(edges[own], colors=colour[name], linewidths=thin, capstyle="round"))
        label = name.removeprefix(JOINT)
        if name in of_set:
            angle, density = of_set[name]["mean_angle_deg"], of_set[name]["p21_per_m"]
            label += "  none in the rock" if angle is None else f"  {angle:.0f}°, P21 {density:.2g} m/m²"
        keys.append(Line2D([], [], color=colour[name], lw=2.2, label=f"joints {label}"))
    return keys


def _draw_cracks(axes: Axes, problem: Problem, thin: float, size: float) -> list[Any]:
    """Cracks, and the rock bridges that one of them may cross; returns legend entries."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    blocks, cracks = problem.blocks, problem.cracks
    keys: list[Any] = []
    segments = cracks.nodes[cracks.segments]
    axes.add_collection(
        LineCollection([*segments], colors=CRACK, linewidths=1.5 * max(thin, 0.8), capstyle="round", zorder=4)
    )
    keys.append(Line2D([], [], color=CRACK, lw=2.6, label=f"cracks ({cracks.n_cracks})"))
    bridges = rock_bridges(blocks, cracks)
    # A bridge as long as the drawing is just rock: only those that a crack may cross are shown.
    short = bridges[np.hypot(*(bridges[:, 1] - bridges[:, 0]).T) < 0.25 * size] if len(bridges) else bridges
    if len(short):
        axes.add_collection(
            LineCollection(
                [*short], colors=BRIDGE, linewidths=max(0.8 * thin, 0.7), linestyles=(0, (1.2, 1.6)), zorder=3
            )
        )
        keys.append(Line2D([], [], color=BRIDGE, lw=1.6, ls=(0, (1.2, 1.6)), label=f"rock bridges ({len(bridges)})"))
    return keys


def joint_colours(scene: Any) -> dict[str, str]:
    """Colour of each kind of joint of a loaded scene, by its edge name."""
    joints = [name for name in scene.drawing.blocks.edge_names if name.startswith(JOINT)]
    joints += [name for name in scene.drawing.joints if name not in joints]
    return {name: SETS[k % len(SETS)] for k, name in enumerate(joints)}


def _conditions(axes: Any, scene: Any, problem: Problem, edges: np.ndarray, size: float) -> list[Any]:
    """Loads and supports; returns legend entries."""
    from matplotlib.lines import Line2D

    blocks, loads, end, keys = problem.blocks, problem.loads, problem.run.end_time, []
    for traction in loads.edge_tractions:
        value = np.asarray(traction.history.at(end), dtype=float)
        own = edges[blocks.edges_named(traction.edge_name)]
        _arrows(axes, own, value, 0.07 * size)
        text = f"{np.hypot(*value) / 1e6:.3g} MPa on {traction.edge_name}"
        keys.append(Line2D([], [], color=LOAD, lw=0, marker=r"$\downarrow$", ms=10, label=text))
    for load in loads.point_loads:
        value = np.asarray(load.history.at(end), dtype=float)
        _arrows(axes, np.array([[load.at, load.at]]), value, 0.09 * size)
        keys.append(
            Line2D([], [], color=LOAD, lw=0, marker=r"$\downarrow$", ms=10, label=f"force {np.hypot(*value):.3g} N/m")
        )
    for viscous in loads.viscous_boundaries:
        for edge in edges[blocks.edges_named(viscous.edge_name)]:
            axes.plot(*edge.T, color="#17a398", lw=3.5, alpha=0.6, zorder=5)
        keys.append(Line2D([], [], color="#17a398", lw=3.5, alpha=0.6, label=f"viscous boundary: {viscous.edge_name}"))
    named = [
        n
        for n in blocks.edge_names
        if n and not n.startswith(JOINT) and n not in {t.edge_name for t in loads.edge_tractions}
    ]
    for name, mark in zip(named, ("#6a994e", "#bc6c25", "#9d4edd", "#118ab2", "#ad2831", "#3d405b")):
        for edge in edges[blocks.edges_named(name)]:
            axes.plot(*edge.T, color=mark, lw=7, alpha=0.55, solid_capstyle="butt", zorder=0.5)
        keys.append(Line2D([], [], color=mark, lw=7, alpha=0.55, label=f'edges "{name}"'))
    # A grouted bar acts at the joints only, over its whole length.
    bolts = scene.tables.loads.bolts
    for bolt in bolts:
        axes.plot(*np.array([bolt.start, bolt.end]).T, color="#1b1d21", lw=1.6, zorder=6)
    if bolts:
        keys.append(Line2D([], [], color="#1b1d21", lw=1.6, label=f"bolts ({len(bolts)})"))
    if loads.water is not None:
        keys += _water(axes, scene, problem)
    for k, point in enumerate(problem.monitors.values()):
        axes.plot(*point[1], marker="o", ms=6, mfc="white", mec=INK, mew=1.3, zorder=7)
        if k == 0:
            keys.append(Line2D([], [], lw=0, marker="o", ms=6, mfc="white", mec=INK, mew=1.3, label="monitors"))
    gravity = np.asarray(loads.gravity.at(end), dtype=float)
    if gravity.any():
        keys.append(Line2D([], [], lw=0, marker=r"$g$", ms=8, color=INK, label=f"{np.hypot(*gravity):.3g} m/s²"))
    return keys


def _water(axes: Any, scene: Any, problem: Problem) -> list[Any]:
    """The water table at the start, at the end if it has changed, and the deepest ponded water."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    water, blocks = problem.loads.water, problem.blocks
    keys: list[Any] = []
    assert water is not None  # asked for by the caller
    low, high = blocks.vertices[:, 0].min(), blocks.vertices[:, 0].max()
    times = [0.0] if water.level is None else [0.0, problem.run.end_time]
    for k, time in enumerate(times):
        x, y = water.line_at(time)
        inside = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
        dashes = (0, (6, 2)) if k == 0 else (0, (2, 2))
        axes.plot(inside, np.interp(inside, x, y), color=WATER, lw=1.6, ls=dashes, zorder=6)
        label = "water table" if k == 0 else f"water table at {time:g} s"
        keys.append(Line2D([], [], color=WATER, lw=1.6, ls=dashes, label=label))
    deepest = deepest_pond(scene.tables, blocks)
    if deepest is not None:
        pond, time = deepest
        line, ground = water.line_at(time), lowest_over(ground_of(blocks))
        for own in ponds(line, ground):
            every = np.concatenate([line[0], ground[0]])
            x = np.unique(np.concatenate([[own.start, own.end], every[(every > own.start) & (every < own.end)]]))
            axes.fill_between(x, np.interp(x, *ground), np.interp(x, *line), color=WATER, alpha=0.3, lw=0, zorder=1.5)
        keys.append(Patch(facecolor=WATER, alpha=0.3, label=f"ponded water, {pond.depth:.3g} m deep at {time:g} s"))
    return keys


def _arrows(axes: Any, edges: np.ndarray, value: np.ndarray, length: float) -> None:
    """Arrows along ``value`` that end on edges under compression, and start there under tension."""
    if not np.hypot(*value) > 0 or not len(edges):
        return
    step = length * value / np.hypot(*value)
    for a, b in edges:
        n = max(1, round(np.hypot(*(b - a)) / (0.6 * length)))
        outward = np.array([(b - a)[1], -(b - a)[0]])
        for share in (np.arange(n) + 0.5) / n:
            at = a + share * (b - a)
            tail, head = (at, at + step) if value @ outward > 0 else (at - step, at)
            axes.annotate(
                "", xy=head, xytext=tail, arrowprops={"arrowstyle": "-|>", "color": LOAD, "lw": 1.3}, zorder=8
            )


def _path(loops: list[np.ndarray]) -> Any:
    from matplotlib.path import Path as Outline

    points = np.concatenate([np.concatenate([loop, loop[:1]]) for loop in loops])
    codes = np.full(len(points), Outline.LINETO)
    first = 0
    for loop in loops:
        codes[first], codes[first + len(loop)] = Outline.MOVETO, Outline.CLOSEPOLY
        first += len(loop) + 1
    return Outline(points, codes)


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def _caption(statistics: dict[str, Any]) -> str:
    text = statistics["summary"]
    if statistics["sets"]:
        size = statistics["blocks"]["size_m_by_part_passing"]["0.5"]
        text += f"; half of the rock is in blocks up to {size:.2g} m"
    return text
