"""The step path and its loads, compared with the crack solver alone and with publications on en-echelon joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from geomech import ddm
from geomech.ddm.fracture.criteria import maximum_tangential_stress
from geomech.model import Cracks, Cycle, DdmSettings, Problem, whole_network
from geomech.reference.slopes import rock_bridges as published
from geomech.report.study_part import Part

G = 9.81

LIMITS = (
    """With ten joints, failure of the first bridge, at the toe, where the block pushes out, makes all others fail under a
    constant load: each bridge that breaks transfers its load to the next. If the load is reduced to what the tips just
    carry (variant "followed"), every bridge has a load of its own, none higher than the first. If all bridges failed in
    tension at once, with the strength of specimens of rock of this toughness (Zhang 2002), they would carry many times as
    much: the ends of joints concentrate stress, and the strength of a bridge in limit equilibrium is not that of the
    material but that of cracks as long as joints.""",
    """Einstein et al. assume that such bridges fail in tension at 90° to the joints' dip. The cracks start at 70.5°, as under
    pure shear, and turn further; the line between their ends lies between the two directions, and they meet the next joint
    at some distance from its end. A bridge into which cracks grow from both sides is crossed at 90°.""",
    """The only load of the slope is the weight of the whole block, without stress due to erosion or excavation. The ground is
    as deep as it is wide: the pressure of blocks on their base is linear, which in shallow ground doubles K.""",
)


@dataclass
class StepPath:
    """Observer of one run; lengths m, loads in multiples of gravity.

    started    at which the first tip grew;  ``alone`` the same from the crack solver without blocks
    linked     (n_links,) at which joints met, in order of time;  ``places`` (n_links, 2) m, where
    failed     at which the path cut the slope (nan: it did not)
    kink       angle to which the first tip turned, rad
    cracks     at the end, those too along which the slope was cut;  ``multiples`` of all cycles by their number
    grown      new crack of every cycle;  ``cut_off`` the outline of the block
    """

    started: float = math.nan
    failed: float = math.nan
    linked: list[float] = field(default_factory=list)
    places: list[tuple[float, float]] = field(default_factory=list)
    kink: float = math.nan
    cracks: Cracks | None = None
    multiples: dict[int, float] = field(default_factory=dict)
    grown: list[float] = field(default_factory=list)

    def on_start(self, problem: Problem, folder: Path) -> None:
        self.cracks = cracks = problem.cracks
        (b,) = np.unique(cracks.block)
        self.outline, self.gravity = problem.blocks.loops(int(b))[0], problem.loads.gravity
        self.rock = problem.materials[problem.blocks.material[int(b)]]
        # Joints from the toe up, each from its lower end.
        joints = cracks.nodes[cracks.segments]
        joints = np.array([joint[np.argsort(joint[:, 1])] for joint in joints])
        self.joints = joints[np.argsort(joints[:, 0, 1])]
        self.n_joints = len(joints)
        along = self.joints[0, 1] - self.joints[0, 0]
        self.dip, self.length = math.atan2(*along[::-1]), float(np.hypot(*along))
        across = np.array([-along[1], along[0]]) / self.length
        self.steps = (self.joints[1:, 0] - self.joints[:-1, 1]) @ across
        self.follows = problem.run.control == "toughness"
        self.friction = problem.face_laws[int(cracks.law[0])].friction_angle
        top = self.outline[:, 1].max()
        brink = self.outline[self.outline[:, 1] > top - 1e-6]
        self.block = np.concatenate([self.joints.reshape(-1, 2), [brink[np.argmin(brink[:, 0])]]])
        self.weight = self.rock.density * G * _area(self.block)
        self.alone = _first_load_alone(problem, self.outline, self.rock)

    def on_cycle(self, cycle: Cycle) -> None:
        now = float(np.hypot(*self.gravity.at(cycle.state.time))) / G
        self.multiples[cycle.number] = now
        self.grown.append(float(cycle.tips["grown"].sum()))
        if math.isnan(self.started) and len(cycle.tips):
            if (cycle.tips["grown"] > 0).any():
                self.started = now
            else:  # once they grow the angle is that of the chord
                self.kink = abs(float(cycle.tips["angle"][np.argmax(cycle.tips["k_eq"])]))
        for event in cycle.events:
            if event.kind == "coalescence":
                self.linked.append(now)
                self.places.append(event.point)
            elif event.kind == "split":
                self.failed = now
                loose = [cycle.blocks.loops(b)[0] for b in range(cycle.blocks.n_blocks) if not cycle.blocks.fixed[b]]
                self.cut_off = min(loose, key=_area)
        self.cracks = whole_network(cycle, self.cracks)

    def on_end(self, summary, error=None) -> None:
        """Nothing is kept of the end."""

    @property
    def held(self) -> float:
        """The largest multiple of gravity at which the slope was stable."""
        return max(self.multiples.values())

    @property
    def links(self) -> np.ndarray:
        """(n_joints − 1,) angle, rad, from the joints' dip to the straight line from each joint's upper end to where
        its crack meets the next one; nan where none does."""
        found = np.full(self.n_joints - 1, np.nan)
        for x, y in self.places:
            k = int(np.argmin(np.hypot(*(self.joints[:-1, 1] - (x, y)).T)))
            dx, dy = np.array((x, y)) - self.joints[k, 1]
            found[k] = math.atan2(dy, dx) - self.dip
        return found

    @property
    def all_at_once(self) -> float:
        """Multiple of gravity at which all bridges would fail together by the tensile strength of the rock (Einstein et
        al. 1983)."""
        strength = published.STRENGTH_OVER_TOUGHNESS * self.rock.k_ic
        return published.high_angle_bridges_multiplier(
            self.weight, self.dip, self.friction, float(self.steps.sum()), strength
        )


def _area(loop: np.ndarray) -> float:
    x, y = loop.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))


def _first_load_alone(problem: Problem, outline: np.ndarray, rock) -> float:
    """The multiple of gravity at which a tip reaches its toughness, from the crack solver with the ground on rollers
    all along its base, elements of order 6. Friction alone resists, so that K grows in proportion to gravity."""
    low = outline[:, 1].min()
    side = next(k for k in range(len(outline)) if max(outline[k, 1], outline[(k + 1) % len(outline), 1]) < low + 1e-6)
    body = ddm.Body(
        [outline], problem.cracks, rock, DdmSettings(6, solver="dense"), supports=[ddm.Support(side, hold="normal")],
        face_laws=problem.face_laws,
    )  # fmt: skip
    tips = body.solve(ddm.BodyLoad(body_force=[0.0, -rock.density * G])).tips
    _, drive = maximum_tangential_stress(tips["k_i"], tips["k_ii"])
    return float(rock.k_ic / drive.max())


def check(name: str, seen: StepPath) -> None:
    """AssertionError if the path differs from the reference."""
    # Blocks press on their base linearly from end to end and hold its ends by friction, an elastic body on rollers as
    # it will: in ground as deep as it is wide 0.3 to 0.7 % are left of that at the joints (a pinned base makes 4 to 6
    # %).
    assert abs(seen.started / seen.alone - 1) < 0.01, f"{name}: the first load is off that of the crack solver alone"
    # Faces in contact: K_I = 0 (a joint's end beside the face of the slope may open a little).
    assert abs(seen.kink - published.KINK) < math.radians(2), f"{name}: the first tip does not kink as in pure shear"
    if not math.isnan(seen.failed):
        assert len(seen.linked) == seen.n_joints - 1, f"{name}: not all joints are part of the path"
        assert seen.started <= seen.held < seen.all_at_once, f"{name}: bridges carry more than all at once"
        # Where a crack also grows from the next joint, both turn towards each other, a little beyond the straight
        # connection.
        assert (seen.links > published.KINK).all() and (seen.links < math.radians(95)).all(), (
            f"{name}: links off bounds"
        )


def report(runs: Mapping[str, StepPath]) -> str:
    """The comparison as text."""
    rows = []
    for name, seen in runs.items():
        links = np.degrees(seen.links[np.isfinite(seen.links)])
        held = f"{seen.held:.4f}" + ("" if math.isfinite(seen.failed) else ", stands")
        rows.append((
            name, seen.n_joints, f"{seen.started:.4f}", f"{seen.alone:.4f}",
            f"{100 * (seen.started / seen.alone - 1):+.2f}", held, f"{seen.all_at_once:.0f}",
            f"{math.degrees(seen.kink):.1f}°", f"{links.min():.0f}° to {links.max():.0f}°" if len(links) else "",
        ))  # fmt: skip
    headers = (
        "run", "joints", "starts at, g", "crack solver alone", "off, %", "holds up to, g", "all bridges at once", "first turn",
        "links, from the dip",
    )  # fmt: skip
    loads = Part("The load of failure", headers, rows, after=[" ".join(words.split()) for words in LIMITS])
    return loads.text()


def draw(seen: StepPath, file: Path) -> None:
    """The path, coloured by the load at which it grew, and the loads at which bridge after bridge broke."""
    import matplotlib
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    ink, rock = "#2f3136", "#e6e3dc"
    figure = Figure(figsize=(10.5, 5.2), layout="constrained")
    slope, loads = figure.subplots(1, 2, width_ratios=[1.25, 1])
    slope.fill(*seen.outline.T, color=rock)
    if not math.isnan(seen.failed):
        slope.fill(*seen.cut_off.T, color="#d9a441", alpha=0.5)
        slope.plot(*np.vstack([seen.cut_off, seen.cut_off[:1]]).T, color="#8a6a20", lw=0.8)
    colours, scale = matplotlib.colormaps["viridis_r"], Normalize(0, seen.held)
    for joint in seen.joints:
        slope.plot(*joint.T, color=ink, lw=1.6)
    cracks = seen.cracks
    for segment, birth in zip(cracks.nodes[cracks.segments], cracks.birth_cycle):
        if birth:
            slope.plot(*segment.T, color=colours(scale(seen.multiples[int(birth)])), lw=3, solid_capstyle="round")
    x, top = seen.joints[:, 1, 0].max(), seen.outline[:, 1].max()
    slope.set(aspect="equal", xlim=(-4, x + 5), ylim=(-3, top + 1.5), xlabel="m")
    slope.set_title("Joints, and the cracks that link them", fontsize=10)
    at, grown = np.array(list(seen.multiples.values())), np.array(seen.grown)
    length = np.cumsum(grown) - grown  # when the load is borne
    grows = grown > 0
    loads.plot(length, at, color="0.7", lw=1)
    loads.scatter(length[grows], at[grows], c=colours(scale(at[grows])), s=26, zorder=3)
    loads.axhline(seen.alone, color=ink, ls="--", lw=1)
    loads.text(
        0.98, seen.alone, "first tip, crack solver alone", transform=loads.get_yaxis_transform(), ha="right",
        va="bottom",
        fontsize=8,
    )  # fmt: skip
    loads.set(ylim=(0, 1.15 * at.max()), xlabel="new crack, m", ylabel="multiple of gravity")
    loads.set_title("The load that the tips just bear" if seen.follows else "The load, and what it breaks", fontsize=10)
    for axes in (slope, loads):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=130)
