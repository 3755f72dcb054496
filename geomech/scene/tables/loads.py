"""Loads on the blocks: [loads]."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from .entries import Finite, Names, NotNegative, Pair, Points, Positive, Table


def _refuse_uneven(times: tuple | None, values: tuple | None, name: str) -> None:
    """A table in time needs a value, the key ``name``, for each of its ascending times."""
    if values is None or times is None or len(values) != len(times) or not values:
        raise ValueError(f"`times_s` and `{name}` need the same number of entries, at least one")
    if any(b <= a for a, b in itertools.pairwise(times)):
        raise ValueError("`times_s` must increase")


class Timed(Table):
    """A vector in time: exactly one of value, rate, times with values, or a file; a value may be a sinusoid."""

    start_s: NotNegative = Field(0.0, description="start of the rate or the sinusoid, s")
    frequency_hz: Positive | None = Field(
        None, description="the constant is the amplitude of a sinusoid of this frequency, Hz (unset: it is constant)"
    )
    phase_deg: Finite = Field(0.0, description="phase of the sinusoid at `start_s`, degrees")
    until_s: Positive | None = Field(None, description="the sinusoid ends at this time, s (unset: never)")
    file: str | None = Field(
        None,
        description="record in a text file, relative to the scene: time and values in a line, with a header "
        '"time [s], x [kPa], y [kPa]" or in SI units',
    )
    direction: Pair | None = Field(
        None, description="direction [x, y] by which a record with one column of values is multiplied"
    )
    times_s: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="times of a piecewise linear history, s, ascending"
    )

    def _parts(self) -> tuple:
        raise NotImplementedError

    @model_validator(mode="after")
    def _one_history(self):
        value, rate, values, names = self._parts()
        given = [value is not None, rate is not None, values is not None or self.times_s is not None]
        if sum(given) + (self.file is not None) != 1:
            raise ValueError(
                f"give exactly one of `{names[0]}`, `{names[1]}`, or `times_s` with `{names[2]}` (or a `file`)"
            )
        if given[2]:
            _refuse_uneven(self.times_s, values, names[2])
        if self.frequency_hz is not None and value is None:
            raise ValueError(f"`frequency_hz` belongs to `{names[0]}`, the amplitude")
        if (self.phase_deg or self.until_s is not None) and self.frequency_hz is None:
            raise ValueError("`phase_deg` and `until_s` belong to `frequency_hz`")
        if self.until_s is not None and not self.until_s > self.start_s:
            raise ValueError("the sinusoid must end after it starts")
        if self.start_s and rate is None and self.frequency_hz is None:
            raise ValueError(f"`start_s` belongs to `{names[1]}`")
        if self.direction is not None and self.file is None:
            raise ValueError("`direction` belongs to `file`")
        return self


class ProfileTable(Table):
    """Variation of a traction along its edge."""

    start: Pair = Field(description="start of the line along which the traction varies, [x, y], m")
    end: Pair = Field(description="its end, [x, y], m")
    factors: Pair = Field(description="factors on the traction at the two points, linear between and beyond them")

    @model_validator(mode="after")
    def _two_points(self):
        if self.start == self.end:
            raise ValueError("`start` and `end` are the same point")
        return self


class TractionTable(Timed):
    """[[loads.tractions]]: a traction on a named edge."""

    edge: str = Field(description="name of the edges it acts on")
    follower: bool = Field(False, description="true: it rotates with its block (unset: it keeps its direction)")
    profile: ProfileTable | None = Field(None, description="linear distribution along the edges (unset: uniform)")
    value_pa: Pair | None = Field(None, description="constant traction [x, y], Pa")
    rate_pa_per_s: Pair | None = Field(None, description="traction that grows from zero, [x, y], Pa/s")
    values_pa: Points | None = Field(None, description="tractions [[x, y], …] at `times_s`, Pa")

    def _parts(self):
        return self.value_pa, self.rate_pa_per_s, self.values_pa, ("value_pa", "rate_pa_per_s", "values_pa")


class ForceTable(Timed):
    """[[loads.forces]]: a force at a point."""

    at: Pair | None = Field(None, description="material point it acts on, [x, y], m")
    point: str | None = Field(
        None, description='name of the drawn point it acts on, such as "load:crane", in place of `at`'
    )
    zone: str | None = Field(None, description="zone of that point, where two zones touch")
    follower: bool = Field(False, description="true: it rotates with its block (unset: it keeps its direction)")
    value_n_per_m: Pair | None = Field(None, description="constant force [x, y] per metre of thickness, N/m")
    rate_n_per_m_s: Pair | None = Field(None, description="force that grows from zero, [x, y], N/m per s")
    values_n_per_m: Points | None = Field(None, description="forces [[x, y], …] at `times_s`, N/m")

    @model_validator(mode="after")
    def _has_place(self):
        if (self.at is None) == (self.point is None):
            raise ValueError("a force acts `at` a place, or on a drawn `point`")
        return self

    def _parts(self):
        names = ("value_n_per_m", "rate_n_per_m_s", "values_n_per_m")
        return self.value_n_per_m, self.rate_n_per_m_s, self.values_n_per_m, names


class ViscousBoundaryTable(Table):
    """[[loads.viscous_boundaries]]: an absorbing edge."""

    edge: str = Field(description="name of the edges that absorb waves (dynamic runs)")
    times_s: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="times of `incoming_m_per_s`, s, ascending"
    )
    incoming_m_per_s: Points | None = Field(
        None, description="particle velocity [[x, y], …] of a wave that enters there, at `times_s`, m/s (unset: none)"
    )

    @model_validator(mode="after")
    def _one_history(self):
        if (self.times_s is None) != (self.incoming_m_per_s is None):
            raise ValueError("a wave takes `times_s` and `incoming_m_per_s` together")
        if self.times_s is not None:
            _refuse_uneven(self.times_s, self.incoming_m_per_s, "incoming_m_per_s")
        return self


class MotionTable(Timed):
    """[[loads.motions]]: a block with prescribed motion."""

    zone: str = Field(description="zone whose blocks have this motion, fixed ones included")
    axes: Literal["x", "y", "xy"] = Field("xy", description="prescribed components; the others stay free")
    turns: bool = Field(False, description="true: the blocks may rotate (unset: they do not)")
    displacement_m: Pair | None = Field(None, description="constant displacement [x, y], m (an amplitude)")
    velocity_m_per_s: Pair | None = Field(None, description="velocity [x, y], m/s, from `start_s` on")
    displacements_m: Points | None = Field(None, description="displacements [[x, y], …] at `times_s`, m")

    def _parts(self):
        names = ("displacement_m", "velocity_m_per_s", "displacements_m")
        return self.displacement_m, self.velocity_m_per_s, self.displacements_m, names


class PointMotionTable(Timed):
    """[[loads.point_motions]]: a point with prescribed motion."""

    at: Pair = Field(description="material point with this motion, [x, y], m")
    zone: str | None = Field(None, description="zone of that point, where two zones touch")
    axes: Literal["x", "y", "xy"] = Field("xy", description="prescribed components; the others stay free")
    stiffness_n_per_m: Positive | None = Field(
        None,
        description="stiffness of the spring that moves it, N/m per metre of thickness (unset: the motion is imposed exactly)",
    )
    displacement_m: Pair | None = Field(None, description="constant displacement [x, y], m (an amplitude)")
    velocity_m_per_s: Pair | None = Field(None, description="velocity [x, y], m/s, from `start_s` on")
    displacements_m: Points | None = Field(None, description="displacements [[x, y], …] at `times_s`, m")

    def _parts(self):
        names = ("displacement_m", "velocity_m_per_s", "displacements_m")
        return self.displacement_m, self.velocity_m_per_s, self.displacements_m, names


class BaseTable(Timed):
    """[loads.base]: the motion of the ground."""

    frame: Literal["ground", "base"] = Field(
        "ground",
        description='"ground": the fixed blocks follow the record; "base": they stay in place, and blocks are '
        "subject to minus the acceleration",
    )
    baseline: Literal["", "constant", "linear"] = Field(
        "", description="baseline subtracted from a record or table so that the base comes to rest"
    )
    acceleration_m_s2: Pair | None = Field(None, description="constant acceleration [x, y], m/s² (an amplitude)")
    jerk_m_s3: Pair | None = Field(None, description="acceleration that grows from zero, [x, y], m/s³")
    accelerations_m_s2: Points | None = Field(None, description="accelerations [[x, y], …] at `times_s`, m/s²")

    def _parts(self):
        names = ("acceleration_m_s2", "jerk_m_s3", "accelerations_m_s2")
        return self.acceleration_m_s2, self.jerk_m_s3, self.accelerations_m_s2, names

    @model_validator(mode="after")
    def _has_baseline(self):
        if self.baseline and self.times_s is None and self.file is None:
            raise ValueError("`baseline` belongs to a record: `file`, or `times_s` with `accelerations_m_s2`")
        return self


class WaterTableTable(Table):
    """[loads.water]: the water table."""

    points: Points | None = Field(
        None, description="the water table, [[x, y], …], m, x ascending, level beyond its ends (unset: the drawing's)"
    )
    line: str | None = Field(
        None, description='name of the drawn line that is the water table, such as "water:high" (unset: "water")'
    )
    unit_weight_n_per_m3: Positive = Field(9810.0, description="unit weight of water, N/m³")
    dry_edges: Names = Field((), description="names of edges that stay dry")
    level_times_s: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="times of `levels_m`, s, ascending"
    )
    levels_m: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="rise of the whole table at `level_times_s`, m"
    )
    follows_ground: bool = Field(
        False,
        description="true: the table is never above the ground, which it follows in front of a slope (unset: water "
        "stands there as a lake that presses on the rock)",
    )

    @model_validator(mode="after")
    def _line(self):
        if self.points is not None and self.line is not None:
            raise ValueError("give either `points`, or the name of a drawn `line`")
        xs = [x for x, _ in self.points] if self.points is not None else [0.0]
        if not xs or any(b <= a for a, b in itertools.pairwise(xs)):
            raise ValueError("`points` needs at least one point, with increasing x")
        if (self.level_times_s is None) != (self.levels_m is None):
            raise ValueError("give `level_times_s` and `levels_m` together")
        if self.level_times_s is not None:
            if len(self.level_times_s) != len(self.levels_m) or not self.levels_m:
                raise ValueError("`level_times_s` and `levels_m` need the same number of entries, at least one")
            if any(b <= a for a, b in zip(self.level_times_s[:-1], self.level_times_s[1:])):
                raise ValueError("`level_times_s` must increase")
        return self


class BoltTable(Table):
    """[[loads.bolts]]: a bolt between two points."""

    name: str = Field("bolt", description="name of the bolt in history.csv (unset for drawn ones: their own)")
    start: Pair | None = Field(None, description="one end, a material point of a block, [x, y], m")
    end: Pair | None = Field(None, description="the other end, [x, y], m")
    lines: Names = Field(
        (),
        description='names of drawn lines for these bolts, with wildcards, such as ["bolt:roof", "bolt:wall*"], '
        "in place of `start` and `end`",
    )
    zone: str | None = Field(None, description="zone of the start, where two zones touch")
    end_zone: str | None = Field(None, description="zone of the end, where two zones touch")
    end_in_ground: bool = Field(False, description="true: its end is fixed to the ground, whatever block is there")
    stiffness_n_per_m: Positive | None = Field(None, description="EA/L, N/m per metre of thickness")
    axial_stiffness_n: Positive | None = Field(
        None, description="EA of a fully grouted bar, N per metre of thickness; it acts at every joint that it crosses"
    )
    active_length_m: Positive | None = Field(
        None, description="length about a joint over which a grouted bar strains, m"
    )
    pretension_n_per_m: NotNegative = Field(0.0, description="force at installation, N/m")
    yield_force_n_per_m: Positive | None = Field(
        None,
        description="force at which it yields, N/m (unset: never, and `geomech safety` takes its force before the "
        "blocks move)",
    )
    breaking_strain: Positive | None = Field(None, description="strain at which it breaks (unset: it does not)")
    shear_stiffness_n_per_m: NotNegative = Field(0.0, description="stiffness across its axis (dowel), N/m")
    shear_strength_n_per_m: Positive | None = Field(None, description="largest force across its axis, N/m")
    start_s: NotNegative = Field(0.0, description="time of its installation, s")
    compression: bool | None = Field(
        None, description="true: it also acts in compression (unset: grouted bars do, others go slack)"
    )

    @model_validator(mode="after")
    def _one_kind(self):
        if bool(self.lines) == (self.start is not None) or (self.start is None) != (self.end is None):
            raise ValueError("give `start` and `end`, or the names of drawn `lines`")
        grouted = self.axial_stiffness_n is not None
        if grouted == (self.stiffness_n_per_m is not None):
            raise ValueError("give `stiffness_n_per_m`, or `axial_stiffness_n` of a grouted bar")
        if grouted != (self.active_length_m is not None):
            raise ValueError("`axial_stiffness_n` and `active_length_m` go together")
        if grouted and (self.end_in_ground or self.zone is not None or self.end_zone is not None):
            raise ValueError("a grouted bar finds its blocks itself: leave out `zone`, `end_zone` and `end_in_ground`")
        if self.start is not None and self.start == self.end:
            raise ValueError("both ends of the bolt are the same point")
        if self.yield_force_n_per_m is not None and self.pretension_n_per_m > self.yield_force_n_per_m:
            raise ValueError("the pretension exceeds the yield force")
        return self


class ExcavationTable(Table):
    """[[loads.excavations]]: blocks to be excavated."""

    time_s: NotNegative = Field(description="time of the excavation, s")
    zones: Names = Field((), description="zones whose blocks are excavated")
    polygon: Points | None = Field(
        None, description="polygon: blocks with their centroid inside are excavated, [[x, y], …], m"
    )
    drained: bool = Field(True, description="true: water no longer acts on faces that touched them")

    @model_validator(mode="after")
    def _has_content(self):
        if not self.zones and self.polygon is None:
            raise ValueError("give `zones` or a `polygon`")
        if self.polygon is not None and len(self.polygon) < 3:
            raise ValueError("a polygon has at least three points")
        return self


class InSituTable(Table):
    """[loads.in_situ]: the stress in the rock before the run."""

    surface_m: Finite | None = Field(None, description="level of the surface, m: stress grows with the depth below it")
    unit_weight_n_per_m3: NotNegative | None = Field(None, description="unit weight of the rock above, ρg, N/m³")
    k0: NotNegative | None = Field(None, description="horizontal over vertical stress")
    surcharge_pa: NotNegative = Field(0.0, description="pressure on the surface, Pa")
    stress_pa: Annotated[tuple[Finite, Finite, Finite], Strict(False)] | None = Field(
        None, description="stress [xx, yy, xy] at `about`, Pa, tension positive, instead of a surface"
    )
    gradient_x_pa_per_m: Annotated[tuple[Finite, Finite, Finite], Strict(False)] = Field(
        (0.0, 0.0, 0.0), description="its change along x, Pa/m"
    )
    gradient_y_pa_per_m: Annotated[tuple[Finite, Finite, Finite], Strict(False)] = Field(
        (0.0, 0.0, 0.0), description="its change along y, Pa/m"
    )
    about: Pair = Field((0.0, 0.0), description="point at which `stress_pa` is given, [x, y], m")

    @model_validator(mode="after")
    def _one_way(self):
        level = [self.surface_m, self.unit_weight_n_per_m3, self.k0]
        if self.stress_pa is None and any(part is None for part in level):
            raise ValueError("give `surface_m`, `unit_weight_n_per_m3` and `k0`, or `stress_pa`")
        if self.stress_pa is not None and any(part is not None for part in level):
            raise ValueError("give either a surface with `k0`, or `stress_pa`, not both")
        return self


class Rising(Table):
    """A load on unbounded rock: exactly one of value, rate, or times with values."""

    start_s: NotNegative = Field(0.0, description="start of the rate, s")
    times_s: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="times of `values_pa`, s, ascending"
    )

    @model_validator(mode="after")
    def _one_history(self):
        given = [self.value_pa is not None, self.rate_pa_per_s is not None]
        table = self.values_pa is not None or self.times_s is not None
        if sum(given) + table != 1:
            raise ValueError("give exactly one of `value_pa`, `rate_pa_per_s`, or `times_s` with `values_pa`")
        if table:
            _refuse_uneven(self.times_s, self.values_pa, "values_pa")
        if self.start_s and not given[1]:
            raise ValueError("`start_s` belongs to `rate_pa_per_s`")
        return self


Stress = Annotated[tuple[Finite, Finite, Finite], Strict(False)]


class RemoteTable(Rising):
    """[[loads.remote]]: remote stress in unbounded rock."""

    value_pa: Stress | None = Field(None, description="constant stress [xx, yy, xy], Pa, tension positive")
    rate_pa_per_s: Stress | None = Field(None, description="stress that grows from zero, [xx, yy, xy], Pa/s")
    values_pa: Annotated[tuple[Stress, ...], Strict(False)] | None = Field(
        None, description="stresses [[xx, yy, xy], …] at `times_s`, Pa"
    )


class FluidTable(Rising):
    """[[loads.fluids]]: fluid pressure in cracks and holes."""

    fills: Annotated[tuple[Literal["cracks", "holes"], ...], Strict(False), Field(min_length=1)] = Field(
        ("cracks",), description='"cracks", including their growth, "holes", or both'
    )
    cracks: Names = Field(
        (), description='names of the cracks into which it is pumped, "*" matches anything (unset: it fills all cracks)'
    )
    connected: bool | None = Field(
        None,
        description="true: it also fills cracks connected with those `cracks`, or with holes that it fills, "
        "now or later (unset: true if `cracks` are named)",
    )
    value_pa: Finite | None = Field(None, description="constant pressure, Pa")
    rate_pa_per_s: Finite | None = Field(None, description="pressure that grows from zero, Pa/s")
    values_pa: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="pressures at `times_s`, Pa"
    )

    @model_validator(mode="after")
    def _in_cracks(self):
        if self.cracks and "cracks" not in self.fills:
            raise ValueError('`cracks` names cracks that it fills: `fills` has to hold "cracks"')
        if self.connected and "cracks" in self.fills and not self.cracks:
            raise ValueError("it fills all cracks already: name those it is pumped into in `cracks`")
        return self


class LoadsTable(Table):
    """[loads]: all loads on the rock."""

    gravity_m_s2: Pair = Field((0.0, 0.0), description="acceleration of gravity [x, y], m/s²")
    gravity_ramp_s: NotNegative = Field(
        0.0, description="time over which gravity, and with it the weight of water, grows linearly, s"
    )
    leading_edge: str | None = Field(
        None,
        description="edges whose traction is the leading load of a run, positive in compression; for a zone with "
        'prescribed motion, its reaction over their length; "gravity": the weight ρgh of a column as '
        "high as the moving blocks (unset: the first traction's)",
    )
    tractions: Annotated[tuple[TractionTable, ...], Strict(False)] = Field((), description="tractions on named edges")
    forces: Annotated[tuple[ForceTable, ...], Strict(False)] = Field((), description="forces on points")
    viscous_boundaries: Annotated[tuple[ViscousBoundaryTable, ...], Strict(False)] = Field(
        (), description="named edges that absorb waves, or let one in"
    )
    water: WaterTableTable | None = Field(None, description="water in all joints below a water table")
    base: BaseTable | None = Field(None, description="shaking of the base")
    motions: Annotated[tuple[MotionTable, ...], Strict(False)] = Field((), description="blocks with prescribed motion")
    point_motions: Annotated[tuple[PointMotionTable, ...], Strict(False)] = Field(
        (), description="points with prescribed motion"
    )
    bolts: Annotated[tuple[BoltTable, ...], Strict(False)] = Field((), description="bolts and anchors")
    excavations: Annotated[tuple[ExcavationTable, ...], Strict(False)] = Field(
        (), description="blocks excavated during the run"
    )
    in_situ: InSituTable | None = Field(
        None, description="stress of the rock before the run; displacements are relative to its equilibrium"
    )

    remote: Annotated[tuple[RemoteTable, ...], Strict(False)] = Field(
        (),
        description='remote stresses in unbounded rock (zones.NAME.body = "plane" or "half-plane"); they add up',
    )
    fluids: Annotated[tuple[FluidTable, ...], Strict(False)] = Field(
        (),
        description="fluid pressures in the cracks and holes of such rock; they add up and are the leading load if there are any",
    )

    @property
    def timed(self) -> list[tuple[tuple, Timed]]:
        """Every load that is a function of time, with its path in the section."""
        lists = ("tractions", "forces", "motions", "point_motions")
        found = [((name, k), load) for name in lists for k, load in enumerate(getattr(self, name))]
        return found + ([(("base",), self.base)] if self.base is not None else [])
