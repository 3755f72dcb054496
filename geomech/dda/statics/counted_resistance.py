"""Resistance other than joint strength in a factor of safety: toes, anchors, cohesion of partly open faces, wedging of
blocks; and the warnings about it."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...model import GROUND, OPEN, Blocks, JointLaw, Loads, State
from ..joint_laws.whole_faces import WholeFaces
from ..kinematics.simplex_integration import block_moments
from ..kinematics.tolerances import LITTLE, NOTABLE, NOTHING, ONE_FACE_SIN
from ..loads.bolts import labels
from ..open_close.contact_set import ContactSet
from ..open_close.static_splitting import NOT_BALANCED
from ..results import CrackResponse
from ..step_control.relative_motion import Windows
from ..system import BlockSystem
from .displacement_limit import FARTHEST, MOVED
from .pseudo_time_equilibrium import RelaxationLimits, equilibrium
from .safety_answer import Anchor, FactorOfSafety
from .sharp_toes import FREE, ROUNDED, Toe, place
from .stability_trial import Trial

log = logging.getLogger(__name__)

#: Number of blocks with toes that are named, and of contacts that carry most where nothing fails.
_LISTED, _CARRYING = 8, 3
#: Part of the largest displacement allowed from which on it is that which keeps a bolt from its yield force.
_NEARLY = 0.9


def toes_in_the_way(
    system: BlockSystem, state: State, failed: Trial | None = None, found: ContactSet | None = None
) -> tuple[Toe, ...]:
    """The toes in ``state`` that are obstacles to the mechanism of the trial ``failed``; all toes if None. ``found``: the
    contacts near ``state``, searched for if None."""
    found = system.contacts_near(state) if found is None else found
    off = system.finder.toes_among(found, state.vertices)
    borne = {(int(row["vertex"]), int(row["edge"])): row for row in state.contacts[state.contacts["state"] != OPEN]}
    centre = block_moments(state.vertices, system.next, system.vertex_start)[:, 1:3]
    out = []
    for k in np.flatnonzero(off >= 0.0):
        a, b = int(found.block[k]), int(found.other[k])
        at = found.geometry[k, 5:7]
        if failed is not None:
            apart = np.zeros(2)
            for block, sign in ((a, 1.0), (b, -1.0)):
                x, y = at - centre[block]
                apart += sign * (failed.displacement[block] + failed.rotation[block] * np.array([-y, x]))
            fastest = float(np.hypot(*failed.displacement.T).max())
            if not apart @ found.geometry[k, 1:3] < -LITTLE * fastest:
                continue
        row = borne.get((int(found.vertex[k]), int(found.edge[k])))
        force = 0.0 if row is None else float(row["normal_force"])
        out.append(
            Toe(a, b, int(found.vertex[k]), int(found.edge[k]), (float(at[0]), float(at[1])), float(off[k]), force)
        )
    return tuple(out)


def bearing_toes(system: BlockSystem, state: State, loads: Loads, load_time: float) -> tuple[Toe, ...]:
    """The toes that bear load in ``state``."""
    weight = system.mass * float(np.hypot(*loads.gravity.at(load_time)))
    system.finder.toes = FREE
    return tuple(toe for toe in toes_in_the_way(system, state) if toe.force > LITTLE * weight[toe.block])


def warn_of_toes(
    system: BlockSystem, begun: State, found: State, loads: Loads, load_time: float, crack: CrackResponse | None = None
) -> None:
    """Log the toes that support blocks at rest in ``found`` if, started from ``begun`` with rounded toes, the blocks
    would collapse. Searches for equilibrium outside `factor_of_safety` use the sharp corners of the drawing."""
    finder = system.finder
    before = finder.toes
    try:
        toes = bearing_toes(system, found, loads, load_time)
        if not toes:
            return
        finder.toes = ROUNDED
        other = equilibrium(
            system, begun, loads, load_time=load_time, crack=crack, limits=RelaxationLimits(follow=False)
        )
    finally:
        finder.toes = before
    if other.collapsed:
        one = len({toe.block for toe in toes}) == 1
        log.warning(
            "t = %g s: %s and hold%s %.4g kN/m with %s sharp tip%s; with rounded toes the blocks are unstable: see the factor of "
            "`geomech safety`",
            load_time, _where(system.blocks, toes), "s" if one else "", sum(toe.force for toe in toes) / 1e3,
            "its" if one else "their", "" if one else "s",
        )  # fmt: skip


def warn_of_toes_at_rest(system: BlockSystem, state: State, loads: Loads) -> None:
    """Log the sharp toes that bear load at the end of a run, in ``state``, under blocks that have hardly moved: runs take
    toes as sharp as drawn, and where they hold, nothing else tells whether the blocks would stand without."""
    finder, blocks = system.finder, system.blocks
    rows = state.contacts[state.contacts["state"] != OPEN]
    if not len(rows):
        return
    # Only blocks that press on one another are looked at, so that no list of neighbours changes by what a run asks at its end.
    pairs = np.unique(np.sort(np.stack([rows["block"], rows["other"]], axis=1), axis=1), axis=0).astype(np.int64)
    size = np.sqrt(np.abs(blocks.areas()))
    near = Windows(pairs, 2.0 * system.settings.corner_rounding * size[pairs].min(axis=1))
    found = finder.find(state.writable(), np.ascontiguousarray(state.vertices), near, lumped=True)
    before = finder.toes
    try:
        finder.toes = ROUNDED
        toes = toes_in_the_way(system, state, found=found)
    finally:
        finder.toes = before
    weight = system.mass * float(np.hypot(*loads.gravity.at(state.time)))
    moved = np.hypot(*blocks.displacements(state.vertices).T)
    still = moved <= LITTLE * size
    bearing = tuple(toe for toe in toes if still[toe.block] and toe.force > NOTABLE * weight[toe.block])
    if bearing:
        log.warning(
            "t = %g s: %s, with corners as sharp as drawn, and bear%s %.4g kN/m. Sharp tips can support blocks that rounded "
            'ones would not: `geomech safety` gives the factor with and without; dda.equilibrium = "start" shows whether the '
            "blocks are stable",
            state.time, _where(blocks, bearing), "s" if len({toe.block for toe in bearing}) == 1 else "",
            sum(toe.force for toe in bearing) / 1e3,
        )  # fmt: skip


def with_toes(
    blocks: Blocks, found: FactorOfSafety, toes: tuple[Toe, ...], other: FactorOfSafety | None, hold: bool
) -> FactorOfSafety:
    """The answer ``found`` with its ``toes``: those that ``hold`` in it, with the ``other`` answer without them; or
    those that would hold with sharp tips, with the ``other`` answer with sharp tips. Nothing is warned of where the
    factor does not depend on those that hold."""
    same = hold and other is not None and other.upper >= found.lower
    lines = () if same else _of_toes(blocks, toes, other, hold)
    factor = None if other is None else other.factor
    return replace(found, toes=toes, toes_hold=hold, other_factor=factor, warnings=(*found.warnings, *lines))


def _of_toes(blocks: Blocks, toes: tuple[Toe, ...], other: Any, hold: bool) -> tuple[str, ...]:
    """Warnings about toes; arguments as for `with_toes`."""

    def factor(of: FactorOfSafety) -> str:
        return f"{of.factor:.4f}" if math.isfinite(of.upper) else f"above {of.lower:g}"

    where, one = _where(blocks, toes), len({toe.block for toe in toes}) == 1
    if hold:
        without = "the blocks do not stand" if other is None else f"the factor is {factor(other)}"
        force = sum(toe.force for toe in toes) / 1e3
        what = "holds" if one else "they hold"
        return (f"{where} and {what} {force:.4g} kN/m; without {'it' if one else 'them'} {without}",)
    off = max(toe.stands_off for toe in toes)
    rounded = (
        f"rounded, it stands off by {off:.3g} m and holds nothing before it has moved that far. A sharp tip would hold"
        if one
        else f"rounded, they stand off by up to {off:.3g} m and hold nothing before they have moved that far. Sharp "
        "tips would hold"
    )
    return (f"{where}; {rounded}: factor {factor(other)}, which is not to be relied on",)


def _where(blocks: Blocks, toes: tuple[Toe, ...]) -> str:
    """Text that names the toes, what they touch, and where."""

    def name(block: int) -> str:
        return repr(blocks.names[block])

    first = toes[0]
    where = f"the toe of {name(first.block)} touches {name(first.other)} at {place(*first.at)}"
    rest = list(dict.fromkeys(name(toe.block) for toe in toes if toe.block != first.block))
    if not rest:
        return where
    more = f" and {len(rest) - _LISTED} others" if len(rest) > _LISTED else ""
    return f"{where} (so do those of {', '.join(rest[:_LISTED])}{more})"


def _anchors(loads: Loads, state: State, moved: np.ndarray) -> tuple[Anchor, ...]:
    """Forces and displacements of the bolts of ``loads`` in ``state``."""
    out = []
    for bolt, name, row in zip(loads.bolts, labels(loads.bolts), state.bolts, strict=False):
        if not row["installed"] or row["broken"]:
            continue
        force = float(row["force"])
        stretch = (force - bolt.pretension) / bolt.stiffness + float(row["plastic"])
        far = max(float(moved[b]) for b in (bolt.block, bolt.other) if b != GROUND)
        out.append(Anchor(name, force, stretch, far, force >= bolt.yield_force * (1.0 - NOTHING)))
    return tuple(out)


def with_anchors(blocks: Blocks, loads: Loads, found: FactorOfSafety) -> FactorOfSafety:
    """The answer ``found`` with its bolt forces, and a warning for bolts without yield force or bolts whose block must
    move visibly before they take load."""
    anchors, lines = _anchors(loads, found.state, found.moved), []
    size = np.sqrt(blocks.areas())
    for bolt, anchor in zip((b for b, row in zip(loads.bolts, found.state.bolts, strict=False)
                             if row["installed"] and not row["broken"]), anchors, strict=True):  # fmt: skip
        least = min(float(size[b]) for b in (bolt.block, bolt.other) if b != GROUND)
        if math.isinf(bolt.yield_force) and anchor.force > bolt.pretension * (1.0 + LITTLE):
            lines.append(
                f"bolt {anchor.name} has no yield force: it counts with the {anchor.force / 1e3:.4g} kN/m that it "
                f"takes while its block moves {1e3 * anchor.moved:.3g} mm"
            )
        elif anchor.moved > MOVED * least and anchor.stretch > 0.0:
            short = ""
            if not anchor.yields and anchor.moved > _NEARLY * FARTHEST * least:
                short = (
                    f"; so soft a bolt does not reach its yield force of {bolt.yield_force / 1e3:.4g} kN/m within the "
                    f"displacement that is allowed, {100 * FARTHEST:g} % of the block's size"
                )
            lines.append(
                f"bolt {anchor.name} takes its {anchor.force / 1e3:.4g} kN/m only once its block has moved "
                f"{1e3 * anchor.moved:.3g} mm, {100 * anchor.moved / least:.2g} % of the block's size{short}"
            )
    return replace(found, anchors=anchors, warnings=(*found.warnings, *lines))


@dataclass(frozen=True)
class PartedFace:
    """A face between ``block`` and ``other`` whose cohesion counts although it is open by up to ``gap`` m at one end,
    over ``length`` m. ``normal``: of the edge of ``other``."""

    block: int
    other: int
    gap: float
    length: float
    normal: tuple[float, float]

    def slides(self, failed: Trial | None) -> bool:
        """Whether its blocks slide along it in the trial ``failed``, rather than part."""
        if failed is None:
            return False
        way = failed.displacement[self.block] - failed.displacement[self.other]
        return abs(float(way @ self.normal)) <= ONE_FACE_SIN * float(np.hypot(*way))


def parted_faces(system: BlockSystem, state: State) -> tuple[PartedFace, ...]:
    """Faces that in ``state`` touch at one end and not at the other, the widest gap first."""
    near = system.contacts_near(state)
    if near.whole is None:
        return ()
    # Contacts that carry cohesion alone may be open (`open_close.plastic_splitting`).
    touching = np.where((near.gap_before > near.precision) & system.plastic, OPEN, near.state)
    open_ends = (touching == OPEN) & (near.bonded > 0) & near.whole.touch(touching)
    face = near.whole.face
    return _faces(near, near.whole, [np.flatnonzero(open_ends & (face == k)) for k in np.unique(face[open_ends])])


def hairline_faces(system: BlockSystem, state: State) -> tuple[PartedFace, ...]:
    """Faces of joints with cohesion that in ``state`` are open at all ends by less than the precision of block
    positions, and therefore carry nothing; the widest gap first."""
    near = system.contacts_near(state)
    cohesion = np.array([joint.cohesion for joint in system.joints])[near.law]
    whole = WholeFaces.of(near.block, near.other, near.geometry, near.law, cohesion)
    if whole is None:
        return ()
    face, is_hairline = whole.face, near.gap_before <= near.precision
    loose = (near.state == OPEN) & (face >= 0) & ~whole.touch(near.state)
    own = [np.flatnonzero(face == number) for number in np.unique(face[loose])]
    return _faces(near, whole, [contacts for contacts in own if is_hairline[contacts].all()])


def _faces(near: ContactSet, whole: WholeFaces, contacts: list[np.ndarray]) -> tuple[PartedFace, ...]:
    """The faces whose open ends are these ``contacts`` (numbers in ``near``), the widest gap first."""
    out = [
        PartedFace(
            int(near.block[own[0]]), int(near.other[own[0]]), float(near.gap_before[own].max()),
            float(whole.length[own].sum()), tuple(near.geometry[own[0], 1:3].tolist()),
        )
        for own in contacts
    ]  # fmt: skip
    return tuple(sorted(out, key=lambda each: -each.gap))


def with_rigid_blocks(found: FactorOfSafety, rigid: FactorOfSafety) -> FactorOfSafety:
    """The answer ``found`` of elastic blocks that touch at few points of faces with cohesion, with that of ``rigid``
    blocks."""
    line = (
        "blocks of uniform strain touch at few points of faces with cohesion, where real blocks would touch at more; rigid "
        f"blocks have the factor {rigid.factor:.4f}, as in limit equilibrium"
    )
    return replace(found, factor_if_rigid=rigid.factor, warnings=(*found.warnings, line))


def as_rigid_blocks(
    blocks: Blocks, loads: Loads, found: FactorOfSafety, loose: tuple[PartedFace, ...], rigid: FactorOfSafety
) -> FactorOfSafety:
    """The answer of ``rigid`` blocks in place of ``found``, that of elastic blocks, whose uniform strain opens the ``loose``
    faces by less than the precision of positions; toes are those of ``found``."""
    worst, one = loose[0], len(loose) == 1
    a, b = blocks.names[worst.block], blocks.names[worst.other]
    line = (
        f"{'a face' if one else f'{len(loose)} faces'} with cohesion between {a!r} and {b!r}{'' if one else ' and others'} would "
        f"open by {1e3 * worst.gap:.2g} mm and hold nothing, but only because blocks have uniform strain: the factor is that of "
        f"rigid blocks, as in limit equilibrium (with uniform strain {found.factor:.4f})"
    )
    of_anchors = with_anchors(blocks, loads, replace(found, warnings=())).warnings
    answer, of_toes = with_anchors(blocks, loads, rigid), found.warnings[len(of_anchors) :]
    return replace(
        answer, toes=found.toes, toes_hold=found.toes_hold, other_factor=found.other_factor, factor_if_rigid=rigid.factor,
        factor_if_strained=found.factor, warnings=(*answer.warnings, *of_toes, line),
    )  # fmt: skip


def with_parted_faces(
    blocks: Blocks, found: FactorOfSafety, parted: tuple[PartedFace, ...], other: FactorOfSafety | None
) -> FactorOfSafety:
    """The answer ``found`` with the faces ``parted`` at one end, and the ``other`` answer in which open ends lose their
    cohesion; None if that was not searched for."""
    worst = parted[0]
    a, b = blocks.names[worst.block], blocks.names[worst.other]
    one = len(parted) == 1
    line = (
        f"{'a face' if one else f'{len(parted)} faces'} with cohesion touch{'es' if one else ''} at one end only, open by "
        f"up to {1e3 * worst.gap:.2g} mm ({a!r} and {b!r}): as in limit equilibrium, cohesion counts on the whole length"
    )
    if other is None:
        return replace(found, warnings=(*found.warnings, line))
    line += f"; were it lost where faces are open, the factor would be {other.factor:.4f}"
    return replace(found, factor_if_parted=other.factor, warnings=(*found.warnings, line))


def with_laws_left_out(found: FactorOfSafety, joints: Sequence[JointLaw]) -> FactorOfSafety:
    """The answer ``found`` without the tensile strength and dilation of ``joints``, and a warning of it: a state of rest without
    tension is one with tensile strength, too, whatever bonds have broken on the way."""
    parts = []
    for what, of in (("tensile strength", "tensile_strength"), ("dilation", "dilation_angle")):
        named = ", ".join(f"{law.name!r}" for law in joints if getattr(law, of) > 0.0)
        parts += [f"the {what} of {named}"] if named else []
    line = (
        f"{' and '.join(parts)} {'are' if len(parts) > 1 else 'is'} not counted among so many blocks: the factor is that of joints "
        f"with friction and cohesion alone, and may be higher with {'them' if len(parts) > 1 else 'it'}"
    )
    return replace(found, warnings=(*found.warnings, line))


def with_displacements(blocks: Blocks, found: FactorOfSafety, drawn: float) -> FactorOfSafety:
    """The answer ``found``, with a warning if it is clearly above the largest factor with admissible forces as ``drawn`` (0: unknown),
    as blocks have moved on the way: soft bolts and joints allow that."""
    if not 0.0 < drawn * (1.0 + NOTABLE) < found.lower:
        return found
    free = ~blocks.fixed
    block = int(np.flatnonzero(free)[found.moved[free].argmax()])
    line = (
        f"the factor is that of blocks which have moved, by up to {1e3 * found.moved[block]:.3g} mm "
        f"({blocks.names[block]!r}), before their forces balance: where they are drawn, no "
        f"contact forces balance the loads above a factor of {drawn:.4f}"
    )
    return replace(found, warnings=(*found.warnings, line))


def with_admissible_forces(found: FactorOfSafety, largest: float | None) -> FactorOfSafety:
    """The answer ``found`` with the ``largest`` factor that has admissible contact forces, if that is clearly larger.
    There is no warning if it is the factor of rigid blocks, which is reported already."""
    if largest is None:
        return found
    rigid = found.factor_if_rigid
    if rigid is not None and largest <= rigid * (1.0 + NOTABLE):
        return replace(found, admissible=largest)
    bound = f"up to a factor of {largest:.4f}" if math.isfinite(largest) else "at more than four times that factor"
    line = (
        f"friction does not determine how the blocks are wedged against one another: contact forces that balance the "
        f"loads within the strength of all joints exist {bound}, which is an upper bound. The factor {found.factor:.4f} "
        "is that of the contact forces which result from the deformation of the blocks, and depends on the stiffness "
        "of blocks and joints"
    )
    failed = min(
        (t for t in found.trials if not t.stable and t.factor >= found.upper), key=lambda t: t.factor, default=None
    )
    if failed is not None and NOT_BALANCED in failed.reason:
        line += (
            f". In the trial at {failed.factor:.4f} {NOT_BALANCED} (no block moved too far): the factor may be too low"
        )
    return replace(found, admissible=largest, warnings=(*found.warnings, line))


def with_no_mechanism(blocks: Blocks, found: FactorOfSafety) -> FactorOfSafety:
    """The answer ``found`` of blocks that no reduction of strength sets in motion, with the contacts that carry most."""
    most = _largest_forces(blocks, found.state)
    carry = f" (most is carried where {'; '.join(most)})" if most else ""
    line = (
        f"blocks stand even with joint strength divided by {found.lower:g}: their shape or anchors hold them, not the "
        f"strength of joints{carry}. Check that every block which could fail is free to move"
    )
    return replace(found, warnings=(*found.warnings, line))


def _largest_forces(blocks: Blocks, state: State) -> list[str]:
    """Texts of the edges with the largest normal forces in ``state``, and where these act."""
    rows = state.contacts[(state.contacts["state"] != OPEN) & (state.contacts["normal_force"] > 0.0)]
    found = []
    for other, edge, block in sorted({(int(r["other"]), int(r["edge"]), int(r["block"])) for r in rows}):
        own = rows[(rows["edge"] == edge) & (rows["block"] == block)]
        force = float(own["normal_force"].sum())
        found.append((force, block, other, own["normal_force"] @ own["point"] / force))
    out = []
    for force, block, other, (x, y) in sorted(found, key=lambda each: -each[0])[:_CARRYING]:
        a, b = blocks.names[block], blocks.names[other]
        out.append(f"{a!r} presses on {b!r}, {force / 1e3:.4g} kN/m at {place(x, y)}")
    return out
