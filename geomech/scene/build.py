"""Converts a checked scene to the problem for the solvers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..model import (
    CHANGES,
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    Problem,
    RunSettings,
    ViscousBoundary,
    rayleigh_coefficients,
)
from ..model.loads.wave_limits import SECOND_ORDER
from .assembly.cells import cells_of
from .assembly.fixed_blocks import block_orders, constrained_unknowns, first_velocities, fixed_blocks
from .assembly.joint_laws import joint_law
from .assembly.load_functions import actions_of, force_history, in_situ_of, profile_of, traction_history
from .checks.check import Check
from .checks.cross_checks import carrier, gauge_carriers, material_of
from .checks.edges import contact_names, dead_end_laws, joint_names
from .drawing import Drawing
from .tables import SceneTables
from .tables.entries import given
from .tables.rock import MaterialTable
from .unbounded_rock import endless_of

#: State changes of contacts are followed in larger models only on request: in a wall they occur at every load.
MOST_WATCHED = 30


def build_problem(tables: SceneTables, drawing: Drawing, check: Check) -> Problem:
    """The `Problem` of a scene without faults."""
    names = list(tables.materials)
    drawn_blocks, drawn_cracks = drawing.assembled()
    blocks = replace(
        drawn_blocks,
        material=np.array([names.index(material_of(tables, zone)) for zone in drawing.zones]),
        fixed=fixed_blocks(tables, drawing),
        constrained=constrained_unknowns(tables, drawing),
        order=block_orders(tables, drawing),
    )
    joints, joint_of = _joints(tables, drawing)
    face_laws, law = _face_laws(tables, drawn_cracks, joints, dead_end_laws(check))
    cracks = replace(drawn_cracks, aperture=_apertures(tables, drawn_cracks), law=law)
    gauge, carriers = tables.gauge, gauge_carriers(check)
    return Problem(
        title=tables.title,
        origin=drawing.origin,
        blocks=blocks,
        cracks=cracks,
        materials=tuple(
            Material(
                name=name,
                youngs_modulus=m.youngs_modulus_pa,
                poissons_ratio=m.poissons_ratio,
                density=m.density_kg_m3,
                k_ic=m.k_ic_pa_sqrt_m if m.k_ic_pa_sqrt_m is not None and tables.growth.enabled else math.inf,
                plane=m.plane,
                rigid=m.rigid,
                tensile_strength=math.inf if m.tensile_strength_pa is None else m.tensile_strength_pa,
                cohesion=math.inf if m.cohesion_pa is None else m.cohesion_pa,
                friction_angle=math.radians(m.internal_friction_angle_deg),
                k_iic=_shear_toughness(m, tables),
            )
            for name, m in tables.materials.items()
        ),
        joints=joints,
        joint_of=joint_of,
        face_laws=face_laws,
        loads=_loads(tables, check),
        in_situ=in_situ_of(tables),
        endless=endless_of(tables, drawing),
        velocity=first_velocities(tables, drawing),
        dda=_dda(tables),
        ddm=DdmSettings(**tables.ddm.model_dump()),
        growth=_growth(tables, cracks),
        run=RunSettings(
            end_time=tables.run.end_time_s,
            stop_at=tables.run.stop_at,
            boundary_stress=tables.run.boundary_stress,
            stepping=tables.run.stepping,
            events=_events(tables, blocks),
            longest_step=tables.run.longest_step_s,
            control=tables.run.control,
            skip=tables.run.skip,
            repeat=tables.run.repeat,
        ),
        load_edge=_leading_edge(tables),
        gauge=None if gauge is None or carriers is None else ((carriers[0], gauge.start), (carriers[1], gauge.to)),
        monitors={
            m.name: (carrier(check, ("monitors", k, "at"), "monitor", m.at, m.zone), given(m.at))
            for k, m in enumerate(tables.monitors)
        },
    )


def _events(tables: SceneTables, blocks: Blocks) -> tuple[str, ...] | None:
    """Events at which steps from event to event end, and which fixed steps report."""
    if tables.run.events is not None:
        return ("tips", *tables.run.events)
    if tables.run.stepping == "fixed":
        return None
    watched = blocks.n_blocks <= MOST_WATCHED or bool(set(tables.run.stop_at) & set(CHANGES))
    return ("tips", "contacts", "faces") if watched else ("tips", "faces")


def _set_of(crack: str) -> str:
    """The joints of which ``crack`` is a dead end: "bedding" of "bedding 12"."""
    return crack.rpartition(" ")[0]


def _crack_entry(tables: SceneTables, crack: str):
    """The entry of [cracks] for a crack: by its name, for a dead end by that of its joints, or the entry for all."""
    for name in (crack, _set_of(crack), "default"):
        if name in tables.cracks:
            return tables.cracks[name]
    return None


def _apertures(tables: SceneTables, cracks: Cracks) -> np.ndarray:
    def metres(name: str) -> float:
        entry = _crack_entry(tables, name)
        aperture = "closed" if entry is None else entry.aperture
        return {"closed": 0.0, "slot": math.inf}[aperture] if isinstance(aperture, str) else float(aperture)

    return np.array([metres(name) for name in cracks.names])[cracks.crack] if cracks.n_segments else np.empty(0)


def _face_laws(
    tables: SceneTables, cracks: Cracks, joints: tuple[JointLaw, ...], dead_ends: dict[str, str | None]
) -> tuple[tuple[JointLaw, ...], np.ndarray]:
    """The laws of crack faces, smooth ones first, and the law of every segment; ``dead_ends`` as in `dead_end_laws`."""
    known = {joint.name: joint for joint in joints}
    laws = [Problem.face_laws[0]]

    def number(crack: str) -> int:
        entry = _crack_entry(tables, crack)
        # The dead end of a joint has the joint's roughness.
        key = dead_ends.get(_set_of(crack)) if entry is None else entry.joint
        if key is None:
            return 0
        law = known[key]
        if law not in laws:
            laws.append(law)
        return laws.index(law)

    of_crack = np.array([number(name) for name in cracks.names], dtype=int)
    return tuple(laws), of_crack[cracks.crack] if cracks.n_segments else np.empty(0, int)


def _joints(tables: SceneTables, drawing: Drawing) -> tuple[tuple[JointLaw, ...], dict[tuple[str, str], int]]:
    """Joint laws, the default first, and the contacts to which each applies."""
    order = sorted(tables.joints, key=lambda name: name != "default")
    laws = [JointLaw("default")] if "default" not in tables.joints else []
    joint_of: dict[tuple[str, str], int] = {}
    known = contact_names(drawing)
    for name in order:
        joint = tables.joints[name]
        for edge in joint_names(joint.edges, known):
            joint_of["", edge] = len(laws)
        for one, other in joint.between:
            joint_of[min(one, other), max(one, other)] = len(laws)
        laws.append(joint_law(name, joint))
    for zone, table in tables.zones.items():
        if table.cell_joint is not None:
            joint_of[cells_of(zone), cells_of(zone)] = [law.name for law in laws].index(table.cell_joint)
    return tuple(laws), joint_of


def _loads(tables: SceneTables, check: Check) -> Loads:
    gravity = History.constant(tables.loads.gravity_m_s2)
    if tables.loads.gravity_ramp_s > 0:
        gravity = History(
            np.array([0.0, tables.loads.gravity_ramp_s]), np.array([[0.0, 0.0], tables.loads.gravity_m_s2])
        )
    return Loads(
        gravity=gravity,
        edge_tractions=tuple(
            EdgeTraction(t.edge, traction_history(t), t.follower, profile_of(t)) for t in tables.loads.tractions
        ),
        point_loads=tuple(
            PointLoad(
                carrier(check, ("loads", "forces", k, "at"), "force", f.at, f.zone),
                given(f.at),
                force_history(f),
                f.follower,
            )
            for k, f in enumerate(tables.loads.forces)
        ),
        viscous_boundaries=tuple(
            ViscousBoundary(
                v.edge, None if v.times_s is None else History(np.array(v.times_s), np.array(v.incoming_m_per_s))
            )
            for v in tables.loads.viscous_boundaries
        ),
        **actions_of(tables, check),
    )


def _dda(tables: SceneTables) -> DdaSettings:
    d = tables.dda
    # Shi's scheme damps waves of 0.5 Hz at 10 ms by 5 % per wavelength, and takes 38 % of the energy of a dropped beam with a
    # period of 5 ms in steps of 0.1 ms, where the trapezoidal rule takes 5 %.
    shaken = d.dynamic_factor == 1.0 and (tables.loads.base is not None or tables.loads.viscous_boundaries)
    swings = shaken or (
        d.dynamic_factor == 1.0 and any(zone.order not in (1, "auto") for zone in tables.zones.values())
    )
    mass, stiffness = 0.0, 0.0
    if d.rayleigh_fractions is not None:
        mass, stiffness = rayleigh_coefficients(d.rayleigh_fractions, given(d.rayleigh_frequencies_hz))
    return DdaSettings(
        time_step=d.time_step_s,
        automatic_time_step=d.automatic_time_step,
        dynamic_factor=d.dynamic_factor,
        newmark=d.newmark if d.newmark is not None else SECOND_ORDER if swings else DdaSettings().newmark,
        spectral_radius=d.spectral_radius,
        equilibrium=d.equilibrium,
        unbalanced_tolerance=d.unbalanced_tolerance,
        damping=d.damping,
        rayleigh_mass=mass,
        rayleigh_stiffness=stiffness,
        max_displacement_ratio=d.max_displacement_ratio,
        normal_penalty=d.normal_penalty_pa,
        shear_penalty=d.shear_penalty_pa,
        springs=d.springs,
        contact=d.contact,
        penetration_tolerance=d.penetration_tolerance,
        order_target=d.order_target,
        corner_rounding=d.corner_rounding,
        max_open_close_iterations=d.max_open_close_iterations,
        max_step_cuts=d.max_step_cuts,
    )


def _shear_toughness(m: MaterialTable, tables: SceneTables) -> float:
    """Toughness against growth in shear; infinite if cracks do not grow, also for lack of a toughness in tension."""
    grows = tables.growth.enabled and m.k_ic_pa_sqrt_m is not None
    return m.k_iic_pa_sqrt_m if grows and m.k_iic_pa_sqrt_m is not None else math.inf


def _growth(tables: SceneTables, cracks: Cracks) -> GrowthSettings:
    g = tables.growth
    increment = g.increment_m
    if increment is None:
        # A tenth of a crack resolves the curvature of its wing crack over its first crack length. Of many cracks the
        # median: the shortest of a hundred traces is a remnant of a centimetre, and grows last. (Of two the shorter one.)
        lengths = np.bincount(cracks.crack, cracks.lengths) if cracks.n_segments else np.array([10e-3])
        lengths = np.sort(lengths[lengths > 0])
        increment = 0.1 * float(lengths[(len(lengths) - 1) // 2])
        if g.min_increment_m is not None:
            increment = max(increment, g.min_increment_m)
    return GrowthSettings(
        criterion=g.criterion,
        increment=increment,
        min_increment=0.1 * increment if g.min_increment_m is None else g.min_increment_m,
        join_distance=g.join_distance,
        join_length=g.join_length_m,
        max_passes=g.max_passes,
        correct=g.correct,
        initiation=g.initiation if g.enabled else "",
        initiation_distance=g.initiation_distance_m,
        initiation_spacing=g.initiation_spacing_m,
        trial_kink=g.trial_kink_m,
        speed_limit=g.speed_limit,
        approach_steps=g.approach_steps,
    )


def _leading_edge(tables: SceneTables) -> str:
    if tables.loads.leading_edge is not None:
        return tables.loads.leading_edge
    return tables.loads.tractions[0].edge if tables.loads.tractions else ""
