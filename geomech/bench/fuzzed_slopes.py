"""Random benched slopes, jointed and cracked, run end to end and watched: what must hold of any scene is held against each cycle.

A seed makes a scene file (outline, joint sets whose dead ends are cracks, rock, laws, water, in-situ stress, shaking, static
or dynamic, fixed steps or events); `watched` loads and runs it. A scene is `RAN`, `REFUSED` with a reason by an error of
ours, `LONG` where its time was up, or `BROKEN`: something did not hold, or another error came.
"""

from __future__ import annotations

import logging
import math
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import dda, ddm
from ..dda.overlap import refuse_overlap
from ..ddm.validity import inside
from ..model import OPEN, Cycle
from .figures import Measured

RAN, REFUSED, LONG, BROKEN = "ran", "refused", "long", "broken"

#: Seeds of scenes that take a second or so, with cracks and without.
LIGHT = (3, 5, 12, 16, 32, 34)

#: Loads of a cracked block balance to this part of their size, they are the block solver's own forces, and its strain (found: up
#: to 0.43 of the one at the start of the step):
#: forces balance on strained blocks, and are put on unstrained ones.
IMBALANCE = 1e-5
#: Rock in the elastic range does not change its area by more than this part.
STRAINED = 1e-2
#: The energy that is not accounted for, over all that was turned over.
UNACCOUNTED = 1e-3


@dataclass(frozen=True)
class Watched:
    """What became of a ``seed``: ``faults`` name the cycle; ``reason`` of a refusal; ``warnings`` as logged."""

    seed: int
    verdict: str
    reason: str = ""
    faults: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    blocks: int = 0
    tips: int = 0
    cycles: int = 0
    events: tuple[str, ...] = ()
    imbalance: float = 0.0
    unaccounted: float = 0.0
    seconds: float = 0.0


def scene_text(seed: int) -> str:
    """The scene file of a ``seed``."""
    rng = np.random.default_rng(seed)
    face, width, height = _outline(rng)
    base = [
        (-4.0, -2.0),
        (width + 2, -2.0),
        (width + 2, height),
        (width, height),
        (width, 0.0),
        (0.0, 0.0),
        (-4.0, 0.0),
    ]
    sets = _joint_sets(rng, height)
    dynamic, events = bool(rng.random() < 0.4), bool(rng.random() < 0.3)
    law = [f"friction_angle_deg = {rng.uniform(5, 50):.1f}"]
    if rng.random() < 0.4:
        law += [
            f"cohesion_pa = {10 ** rng.uniform(3, 6):.0f}",
            f"tensile_strength_pa = {10 ** rng.uniform(3, 5.5):.0f}",
        ]
    density = rng.uniform(2000, 3000)
    lines = [
        f'title = "Fuzzed slope {seed}"',
        f"[geometry]\nseed = {seed}\nshortest_crack_m = {rng.uniform(0.2, 1.0):.2f}\nsmallest_block_m2 = 0.2",
        f'[[geometry.zones]]\nname = "base"\npolygon = {_points(base)}',
        f'[[geometry.zones]]\nname = "rock"\npolygon = {_points(face)}',
        *sets,
        "[materials.rock]",
        f"youngs_modulus_pa = {10 ** rng.uniform(9, 11):.3e}\npoissons_ratio = {rng.uniform(0.05, 0.4):.2f}",
        f"density_kg_m3 = {density:.0f}\nk_ic_pa_sqrt_m = {10 ** rng.uniform(4.5, 6.5):.3e}",
        "[zones.base]\nfixed = true",
        "[joints.default]\n" + "\n".join(law),
    ]
    if rng.random() < 0.6:
        lines.append('[cracks.default]\njoint = "default"')
    elif rng.random() < 0.3:
        lines.append('[cracks.default]\naperture = "slot"')
    lines.append("[loads]\ngravity_m_s2 = [0.0, -9.81]")
    if not dynamic:
        lines.append("gravity_ramp_s = 3.0")
    if rng.random() < 0.3:
        level = height * rng.uniform(0.2, 0.9)
        lines.append(f"[loads.water]\npoints = {_points([(0.0, 0.2 * level), (width, level)])}")
    if dynamic and rng.random() < 0.5:
        amplitude, frequency = rng.uniform(0.5, 5), rng.uniform(1, 8)
        lines.append(
            f"[loads.base]\nacceleration_m_s2 = [{amplitude:.2f}, {0.3 * amplitude:.2f}]\nfrequency_hz = {frequency:.2f}"
        )
    elif not dynamic and rng.random() < 0.3:
        lines[-1] = lines[-1].replace("\ngravity_ramp_s = 3.0", "")
        lines.append(
            f"[loads.in_situ]\nsurface_m = {height}\nunit_weight_n_per_m3 = {9.81 * density:.0f}\nk0 = {rng.uniform(0.2, 1.5):.2f}"
        )
    dt = 10 ** rng.uniform(-3, -2) if dynamic else 1.0
    lines.append(f"[dda]\ntime_step_s = {dt:.5f}\ndynamic_factor = {int(dynamic)}\nmax_displacement_ratio = 0.01")
    if rng.random() < 0.2:
        lines.append('contact = "augmented"')
    if dynamic and rng.random() < 0.3:
        lines.append('equilibrium = "start"')
    lines += [
        "[ddm]\norder = 3\nelements_per_crack = 2\nelements_per_side = 2",
        f"[growth]\nincrement_m = {rng.uniform(0.3, 1.0):.2f}\nmax_passes = 4",
        f"[run]\nend_time_s = {(8 * dt if dynamic else 3.0):.5f}\nstop_at = []",
    ]
    if events and not dynamic:
        lines.append('stepping = "events"')
    return "\n".join(lines) + "\n"


def _outline(rng) -> tuple[list[tuple[float, float]], float, float]:
    """The rock, counter-clockwise from its toe, how wide it is and how high."""
    corners, x, y = [], 0.0, 0.0
    for _ in range(int(rng.integers(1, 4))):
        rise = rng.uniform(3, 6)
        x, y = x + rise / math.tan(math.radians(rng.uniform(45, 88))), y + rise
        corners.append((x, y))
        x += rng.uniform(1.5, 4)
        corners.append((x, y))
    corners.pop()
    width = x + rng.uniform(2, 6)
    rounded = [(round(a, 3), round(b, 3)) for a, b in reversed(corners)]
    width, height = round(width, 3), rounded[0][1]
    return [(0.0, 0.0), (width, 0.0), (width, height), *rounded], width, height


def _joint_sets(rng, height: float) -> list[str]:
    found = []
    for k in range(int(rng.integers(1, 4))):
        lines = [
            f'[[geometry.joint_sets]]\nname = "set{k}"\nzones = ["rock"]',
            f"angle_deg = {rng.uniform(-80, 90):.1f}\nangle_deviation_deg = {rng.uniform(0, 8):.1f}",
            f"spacing_m = {height * rng.uniform(0.3, 0.8):.2f}\nspacing_deviation_m = 0.3",
        ]
        if rng.random() < 0.6:
            lines.append(
                f"length_m = {height * rng.uniform(0.3, 1.2):.2f}\ngap_m = {height * rng.uniform(0.05, 0.4):.2f}"
            )
        found.append("\n".join(lines))
    return found


def _points(points) -> str:
    return "[" + ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in points) + "]"


def measure(quick: bool = False) -> Measured:
    """What became of the first forty seeds, each within ten seconds (``quick``: of six that are light), as text."""
    seeds = LIGHT if quick else range(40)
    every = [watched(seed, 10.0) for seed in seeds]
    lines = ["seed  verdict  blocks   tips cycles imbalance    energy   seconds  events, or why not"]
    for w in every:
        kinds = ", ".join(f"{n} {kind}" for kind, n in sorted(Counter(w.events).items()))
        why = "; ".join(w.faults[:2]) or w.reason.strip().splitlines()[-1] if w.faults or w.reason else kinds
        lines.append(
            f"{w.seed:4d}  {w.verdict:8s}{w.blocks:6d} {w.tips:6d} {w.cycles:6d}   {w.imbalance:7.0e}   {w.unaccounted:7.0e} "
            f"{w.seconds:9.1f}  {why}"
        )
    counts = Counter(w.verdict for w in every)
    lines += ["", "  ".join(f"{counts[verdict]} {verdict}" for verdict in (RAN, LONG, REFUSED, BROKEN))]
    return Measured.of("\n".join(lines), errors={"share of slopes broken": counts[BROKEN] / len(every)})


class _Heard(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []
        self.listens = True

    def emit(self, record: logging.LogRecord) -> None:
        if self.listens:
            self.said.append(record.getMessage())


def watched(seed: int, seconds: float = 20.0, text: str | None = None) -> Watched:
    """Load and run the scene of a ``seed`` (or ``text``) for at most so many ``seconds``, every cycle checked."""
    from ..coupling import cycles
    from ..scene import load_scene
    from ..scene.errors import SceneError

    heard, log, began = _Heard(), logging.getLogger("geomech"), time.perf_counter()
    log.addHandler(heard)
    seen = _Seen(heard)
    verdict, reason = RAN, ""
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"slope_{seed}.toml"
            path.write_text(scene_text(seed) if text is None else text, encoding="utf-8")
            problem = load_scene(path).problem()
        seen.pull = max(law.tensile_strength for law in problem.face_laws)
        for cycle in cycles(problem):
            seen.check(cycle)
            if time.perf_counter() - began > seconds:
                verdict = LONG
                break
    except (SceneError, dda.NotConverged, dda.NoInSituEquilibrium, ddm.NotConverged, ValueError) as refusal:
        verdict, reason = REFUSED, f"{type(refusal).__name__}: {refusal}"
    except Exception:  # noqa: BLE001 (any other is what is looked for)
        verdict, reason = BROKEN, traceback.format_exc(limit=-3)
    finally:
        log.removeHandler(heard)
    if seen.faults:
        verdict = BROKEN
    return Watched(
        seed, verdict, reason, tuple(seen.faults), tuple(heard.said), seen.blocks, seen.tips, seen.cycles,
        tuple(seen.events), seen.imbalance, seen.unaccounted, time.perf_counter() - began,
    )  # fmt: skip


class _Seen:
    """The cycles so far, and what did not hold in them."""

    def __init__(self, heard: _Heard) -> None:
        self.heard = heard
        self.pull = 0.0
        self.faults: list[str] = []
        self.events: list[str] = []
        self.area = self.imbalance = self.unaccounted = self.strain = 0.0
        self.blocks = self.tips = self.cycles = 0

    def check(self, cycle: Cycle) -> None:
        self.cycles += 1
        self.blocks, self.tips = cycle.blocks.n_blocks, max(self.tips, len(cycle.tips))
        self.events += [event.kind for event in cycle.events]
        for fault in (*self._blocks(cycle), *self._statistics(cycle), *_tips(cycle), *_faces(cycle, self.pull)):
            self.faults.append(f"cycle {cycle.number}: {fault}")

    def _blocks(self, cycle: Cycle):
        blocks, vertices = cycle.blocks, cycle.state.vertices
        if not (np.isfinite(vertices).all() and np.isfinite(cycle.state.velocity).all()):
            yield "a block is nowhere"
            return
        before, now = blocks.areas(), blocks.areas(vertices)
        self.area = self.area or before.sum()
        if abs(before.sum() / self.area - 1) > 1e-9:
            yield f"area {before.sum():.9g} m², began with {self.area:.9g}"
        if (np.abs(now / before - 1) > STRAINED).any():
            b = int(np.argmax(np.abs(now / before - 1)))
            yield f"area of {blocks.names[b]} is {now[b] / before[b]:.4f} of what it was"
        moments = dda.block_moments(np.ascontiguousarray(vertices), blocks.next_vertex, blocks.vertex_start)
        # What it warns of is told of drawn blocks; these have moved.
        self.heard.listens = False
        try:
            refuse_overlap(blocks, vertices, moments)
        except ValueError as overlap:
            yield str(overlap).partition(" before they")[0]
        finally:
            self.heard.listens = True

    def _statistics(self, cycle: Cycle):
        told = cycle.statistics
        self.imbalance = max(self.imbalance, told.get("traction_imbalance", 0.0))
        stretch = cycle.motion.gradient.transpose(0, 2, 1) @ cycle.motion.gradient - np.eye(2)
        self.strain = max(self.strain, 0.5 * float(np.abs(stretch).max()))
        if told.get("traction_imbalance", 0.0) > IMBALANCE + self.strain:
            yield f"loads of a cracked block are out of balance by {told['traction_imbalance']:.1e}"
        rest = abs(told.get("energy_residual", 0.0))
        turned = sum(abs(told.get(name, 0.0)) for name in ("gravity_work", "load_work", "crack_work", "friction_loss"))
        if turned > 0:
            self.unaccounted = max(self.unaccounted, rest / turned)
            # (More than a hundredth the budget warns of itself.)
            if rest > UNACCOUNTED * turned and not any("without work" in said for said in self.heard.said):
                yield f"energy of {rest:.3g} J/m is not accounted for, of {turned:.3g} turned over"


def _tips(cycle: Cycle):
    tips = cycle.tips
    if not len(tips):
        return
    k = np.column_stack([tips["k_i"], tips["k_ii"], tips["k_eq"], tips["angle"]])
    if not np.isfinite(k).all():
        yield "a stress intensity factor is not finite"
    for tip in tips:
        if not inside(cycle.blocks.loops(int(tip["block"])), tip["point"][None]).all():
            yield f"a tip of crack {tip['crack']} at {tip['point']} lies outside {cycle.blocks.names[tip['block']]}"


def _faces(cycle: Cycle, bond: float):
    faces = cycle.faces
    if faces is None or not len(faces.segment):
        return
    shut = np.isfinite(cycle.cracks.aperture[faces.segment])
    if not shut.any():
        return
    if not (np.isfinite(faces.opening).all() and np.isfinite(faces.traction).all()):
        yield "a crack face is nowhere"
        return
    # The nodes of collocation: between them polynomials may dip.
    opening, normal, state = faces.opening[shut, 1:-1], faces.traction[shut, 1:-1, 0], faces.state[shut, 1:-1]
    aperture = cycle.cracks.aperture[faces.segment[shut]][:, None]
    scale = max(float(np.abs(faces.opening).max()), float(np.abs(faces.slip).max()), 1e-12)
    if (opening + aperture < -1e-6 * scale).any():
        yield f"crack faces overlap by {-(opening + aperture).min():.2e} m"
    pressed = float(np.abs(normal).max())
    if (normal[state != OPEN] > bond + 1e-6 * pressed).any():
        yield f"closed crack faces pull at each other by {normal[state != OPEN].max():.3g} Pa"
