"""Checks of edge names: those that loads and joints refer to, and those that nothing refers to."""

from __future__ import annotations

import difflib
import fnmatch

from ...model import WEIGHT
from ...shapes.gmsh_models.model_drawing import CRACK
from ...shapes.parts import JOINT
from ..assembly.cells import CELLS
from ..assembly.fixed_blocks import fixed_blocks, holds
from ..drawing import Drawing
from ..locator import Path
from ..validation import nearest
from .check import Check


def check_edges(c: Check) -> None:
    """Loads and joints must name existing edges; names in neither are reported."""
    _tractions(c)
    _joints(c)
    _unused(c)


def _edge_names(c: Check) -> list[str]:
    return [name for name in c.blocks.edge_names if name]


def _tractions(c: Check) -> None:
    if c.tables.loads is None:
        return
    known, blocks = _edge_names(c), c.blocks
    taken = {traction.edge for traction in c.tables.loads.tractions}
    for k, traction in enumerate(c.tables.loads.tractions):
        if traction.edge not in known:
            c.refuse(
                ("loads", "tractions", k, "edge"),
                f"the geometry has no edge {traction.edge!r}",
                _edge_hint(c, traction.edge, known, taken),
            )
    for k, boundary in enumerate(c.tables.loads.viscous_boundaries):
        if boundary.edge not in known:
            c.refuse(
                ("loads", "viscous_boundaries", k, "edge"),
                f"the geometry has no edge {boundary.edge!r}",
                _edge_hint(c, boundary.edge, known, set()),
            )
        elif fixed_blocks(c.tables, c.drawn)[blocks.vertex_block[blocks.edges_named(boundary.edge)]].all():
            c.refuse(
                ("loads", "viscous_boundaries", k, "edge"),
                f"the edges {boundary.edge!r} belong to fixed blocks, where a viscous boundary has no effect",
                "let the zone move: it rests on the boundary itself",
            )
    leading = c.tables.loads.leading_edge
    # If a traction's own edge is wrong, it may be the leading one.
    if leading == WEIGHT and leading not in known:
        if not any(c.tables.loads.gravity_m_s2):
            c.refuse(
                ("loads", "leading_edge"),
                "there is no gravity to be the leading load",
                "set gravity_m_s2 and gravity_ramp_s",
            )
    elif leading is not None and leading not in taken | _moved_edges(c) and taken <= set(known):
        c.refuse(
            ("loads", "leading_edge"),
            f"no traction acts on the leading edge {leading!r}, and no zone with it has a prescribed motion",
            'it must be the edge of one of [[loads.tractions]], or of a zone in [[loads.motions]], or "gravity": '
            + nearest(leading, sorted(taken | _moved_edges(c) | {WEIGHT})),
        )


def _moved_edges(c: Check) -> set[str]:
    """Edge names of zones with prescribed motion."""
    moved, blocks = {motion.zone for motion in c.tables.loads.motions}, c.blocks
    owner = {name: {c.drawn.zones[b] for b in blocks.vertex_block[blocks.edges_named(name)]} for name in _edge_names(c)}
    return {name for name, zones in owner.items() if zones & moved}


def _edge_hint(c: Check, name: str, known: list[str], taken: set[str]) -> str:
    """Suggestion of the edge meant by ``name``.

    Never one on which another traction acts, because two opposite loads on one edge cancel, and never one of another
    kind: a traction on "contact:bottom" would act between blocks.
    """
    brought = c.drawn.choices_with_edge(name)
    kind, colon, _ = name.rpartition(":")
    alike = [edge for edge in known if edge not in taken and edge.startswith(kind + colon)]
    close = difflib.get_close_matches(name, alike, 1, cutoff=0.6) if not brought else []
    listed = ", ".join(f"{edge!r}{' (loaded already)' if edge in taken else ''}" for edge in known)
    hint = (f"did you mean {close[0]!r}? " if close else "") + (
        f"edges are {listed}" if known else "no edge has a name"
    )
    if c.drawn.model is None:
        return f"{hint}; name edges by [[geometry.edges]]"
    if brought:
        return f"the model has it with geometry.parameters.{brought}; now its {hint}"
    if c.drawn.parameters:
        hint += "; edge names may depend on the model's parameters"
    return f"{hint}; the model names edges by physical curves"


def _unused(c: Check) -> None:
    """Names in the model that the scene never uses: a missing load, or a crack without its prefix."""
    t = c.tables
    from_files = c.drawn.model is not None or (t.geometry is not None and t.geometry.traces)
    if not from_files or t.loads is None or t.joints is None:
        return
    used = {load.edge for load in t.loads.tractions} | {edge.edge for edge in t.loads.viscous_boundaries}
    used.update(() if t.loads.water is None else t.loads.water.dry_edges)
    for joint in t.joints.values():
        used.update(joint_names(joint.edges, _edge_names(c)), *joint.between)
    # Joints without a law of their own follow the default one, as usual.
    idle = [
        name for name in _edge_names(c) if name not in used and not name.startswith((JOINT, CELLS)) and not holds(name)
    ]
    if idle:
        c.warn(
            ("geometry", "model" if c.drawn.model is not None else "traces"),
            f"no load and no joint names the edges {', '.join(map(repr, idle))}",
            f'they are unloaded, and follow the default joint where they touch; a crack is called "{CRACK}NAME"',
        )


def joint_names(patterns: tuple[str, ...], known: list[str]) -> list[str]:
    """Those of the ``known`` names that match the ``patterns``, in order."""
    return [name for name in known if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)]


def dead_end_laws(c: Check) -> dict[str, str | None]:
    """Joints that end in rock → the key of [joints] that they follow: the one that names them, else the default; None
    without either. Without those that [cracks] has an entry for."""
    known = contact_names(c.drawn)
    joints = c.tables.joints or {}
    drawn = {crack.name for crack in c.tables.geometry.cracks}
    ends = {name.rpartition(" ")[0] for name in c.cracks.names if not {name, "default"} & set(c.tables.cracks or ())}
    laws: dict[str, str | None] = {}
    for name in sorted(ends - drawn - set(c.tables.cracks or ())):
        if JOINT + name in known:
            naming = [key for key, joint in joints.items() if joint_names(joint.edges, [JOINT + name])]
            laws[name] = naming[-1] if naming else "default" if "default" in joints else None
    return laws


def contact_names(drawing: Drawing) -> list[str]:
    """Names of faces in contact: drawn edges, and the faces of cracks that cut through a block."""
    assert drawing.blocks is not None and drawing.cracks is not None
    names = [name for name in drawing.blocks.edge_names if name] + list(drawing.joints)
    faces = [f"crack:{name}" for name in (*drawing.cracks_drawn, *drawing.cracks.names)]
    return list(dict.fromkeys(names + faces))


def _joints(c: Check) -> None:
    if c.tables.joints is None:
        return
    known = contact_names(c.drawn)
    owner: dict[tuple[str, str], str] = {}

    def claim(pair: tuple[str, str], law: str, path: Path) -> None:
        first = owner.setdefault(pair, law)
        if first != law:
            what = f"edges {pair[1]!r}" if not pair[0] else f"edges {pair[0]!r} and {pair[1]!r}"
            c.refuse(
                path, f"joints {first!r} and {law!r} both claim contacts of {what}", "name them in only one of the two"
            )

    for name, joint in c.tables.joints.items():
        if name == "default":
            if joint.edges or joint.between:
                c.refuse(
                    ("joints", name),
                    "the default joint names edges",
                    "it applies to all contacts that no other joint names",
                )
            continue
        of_a_crack = any(crack.joint == name for crack in (c.tables.cracks or {}).values())
        of_cells = any(zone.cell_joint == name for zone in (c.tables.zones or {}).values())
        if not (joint.edges or joint.between or of_a_crack or of_cells):
            c.refuse(("joints", name), f"joint {name!r} names no edges", 'add edges = ["…"], or call it `default`')
        for k, pattern in enumerate(joint.edges):
            names = joint_names((pattern,), known)
            if not names:
                c.refuse(("joints", name, "edges", k), f"no edge is called {pattern!r}", nearest(pattern, known))
            for found in names:
                claim(("", found), name, ("joints", name, "edges", k))
        for k, pair in enumerate(joint.between):
            for n, edge in enumerate(pair):
                if edge not in known:
                    c.refuse(("joints", name, "between", k, n), f"no edge is called {edge!r}", nearest(edge, known))
            claim((min(pair), max(pair)), name, ("joints", name, "between", k))
    if c.blocks.n_blocks > 1 and "default" not in c.tables.joints:
        c.warn(
            ("joints",),
            "there is no default joint: contacts that no joint names have neither friction nor cohesion",
            "add [joints.default]",
        )
