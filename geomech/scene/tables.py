"""The tables of a scene file. Every key is declared, bounded and described here, once."""

from __future__ import annotations

import itertools
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Strict, field_validator, model_validator

from ..model import rayleigh_coefficients

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
# TOML has arrays only; the numbers in them stay strict.
Pair = Annotated[tuple[Finite, Finite], Strict(False)]
Four = Annotated[tuple[Finite, Finite, Finite, Finite], Strict(False)]
Points = Annotated[tuple[Pair, ...], Strict(False)]
Names = Annotated[tuple[str, ...], Strict(False)]


class Table(BaseModel):
    """A table of the scene: no unknown keys, no silent conversions."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True)


class ZoneShape(Table):
    name: str = Field(description="name of the zone; several zones of one name are several blocks of one kind")
    rectangle: Four | None = Field(None, description="two opposite corners, [x0, y0, x1, y1], m")
    polygon: Points | None = Field(None, description="corners in order, [[x, y], …], m")
    holes: Annotated[tuple[Points, ...], Strict(False)] = Field((), description="polygons cut out, [[[x, y], …], …], m")

    @model_validator(mode="after")
    def _one_outline(self):
        if (self.rectangle is None) == (self.polygon is None):
            raise ValueError("a zone has either `rectangle` or `polygon`")
        return self


class CrackShape(Table):
    name: str = Field(description="name of the crack")
    points: Points | None = Field(None, description="its polyline, [[x, y], …], m")
    centre: Pair | None = Field(None, description="centre of a straight crack, [x, y], m")
    length_m: Positive | None = Field(None, description="length of a straight crack, m")
    angle_deg: Finite | None = Field(None, description="its angle from the horizontal, counter-clockwise, degrees")

    @model_validator(mode="after")
    def _one_line(self):
        straight = [self.centre, self.length_m, self.angle_deg]
        if self.points is not None and any(part is not None for part in straight):
            raise ValueError("a crack has either `points` or `centre`, `length_m` and `angle_deg`, not both")
        if self.points is None and any(part is None for part in straight):
            raise ValueError("a crack needs `points`, or all of `centre`, `length_m` and `angle_deg`")
        return self


class EdgeShape(Table):
    name: str = Field(description='name for block edges, used by loads and joints ("load:top", "joint:bedding")')
    line: Annotated[tuple[Pair, Pair], Strict(False)] = Field(
        description="a straight piece, [[x, y], [x, y]], m: all block edges on it get the name"
    )
    zone: str | None = Field(None, description="name only edges of this zone (unset: of all zones)")


class JointShape(Table):
    name: str = Field(description='name of the joints; the block edges they make are called "joint:NAME"')
    points: Points = Field(description="a polyline along which rock parts, [[x, y], …], m")


_Law = Literal["constant", "normal", "uniform", "lognormal", "exponential"]


class JointSetShape(Table):
    name: str = Field(description='name of the set; the block edges it makes are called "joint:NAME"')
    kind: Literal["parallel", "poisson", "discs", "lines", "voronoi"] = Field(
        "parallel",
        description='"parallel" (spacing, length, gap), "poisson" (traces anywhere: p20), "discs" in space cut by the '
        'section (p32), endless "lines" (p21), edges of "voronoi" cells',
    )
    angle_deg: Finite | None = Field(
        None, description="angle of the traces from the horizontal, counter-clockwise, degrees"
    )
    angle_deviation_deg: NotNegative = Field(0.0, description="its standard deviation, degrees")
    angle_law: _Law = Field("normal", description="its law")
    dip_deg: Annotated[float, Field(ge=0, le=90)] | None = Field(
        None, description="dip of the joints in space, with `dip_direction_deg` in place of `angle_deg`, degrees"
    )
    dip_direction_deg: Finite | None = Field(None, description="azimuth of the dip, clockwise from north, degrees")
    fisher: NotNegative = Field(0.0, description='Fisher\'s constant of the poles of "discs" (0: all alike)')
    spacing_m: Positive | None = Field(None, description='distance between the lines of a "parallel" set, m')
    spacing_deviation_m: NotNegative = Field(0.0, description="its standard deviation, m")
    spacing_law: _Law = Field("normal", description="its law")
    length_m: Positive | None = Field(
        None, description='length of traces, diameter of "discs", m (unset: right through)'
    )
    length_deviation_m: NotNegative = Field(0.0, description="its standard deviation, m")
    length_law: _Law = Field("normal", description="its law")
    gap_m: NotNegative = Field(0.0, description='rock between the traces of one line of a "parallel" set, m')
    gap_deviation_m: NotNegative = Field(0.0, description="its standard deviation, m")
    gap_law: _Law = Field("normal", description="its law")
    p20_per_m2: Positive | None = Field(None, description='traces per area of a "poisson" set, 1/m²')
    p21_per_m: Positive | None = Field(None, description='length of "lines" per area, m/m²')
    p32_per_m: Positive | None = Field(None, description='area of "discs" per volume, m²/m³')
    cell_area_m2: Positive | None = Field(None, description='mean area of "voronoi" cells, m²')
    region: Points | None = Field(None, description="polygon that holds the set, [[x, y], …], m (unset: all rock)")
    ends_on: Names = Field((), description="names of joints or sets before it that its traces end on")
    ends_share: Annotated[float, Field(ge=0, le=1)] = Field(1.0, description="part of the traces that do so")

    @model_validator(mode="after")
    def _complete(self):
        needs = {
            "parallel": "spacing_m", "poisson": "p20_per_m2", "discs": "p32_per_m", "lines": "p21_per_m",
            "voronoi": "cell_area_m2",
        }  # fmt: skip
        if getattr(self, needs[self.kind]) is None:
            raise ValueError(f'a set of kind "{self.kind}" needs `{needs[self.kind]}`')
        for kind, key in needs.items():
            if kind != self.kind and getattr(self, key) is not None:
                raise ValueError(f'`{key}` belongs to kind "{kind}", not to "{self.kind}"')
        if self.kind in ("poisson", "discs") and self.length_m is None:
            raise ValueError(f'a set of kind "{self.kind}" needs `length_m`')
        dips = self.dip_deg is not None, self.dip_direction_deg is not None
        if any(dips) and (not all(dips) or self.angle_deg is not None):
            raise ValueError("give either `angle_deg`, or both `dip_deg` and `dip_direction_deg`")
        if self.kind == "discs" and not all(dips):
            raise ValueError('a set of kind "discs" needs `dip_deg` and `dip_direction_deg`')
        if self.kind in ("parallel", "poisson") and not all(dips) and self.angle_deg is None:
            raise ValueError(f'a set of kind "{self.kind}" needs `angle_deg`, or `dip_deg` and `dip_direction_deg`')
        if self.gap_m > 0 and (self.kind != "parallel" or self.length_m is None):
            raise ValueError('`gap_m` belongs to a "parallel" set with `length_m`')
        return self


class Geometry(Table):
    model: str | None = Field(None, description="Gmsh model (.geo), relative to the scene file")
    parameters: dict[str, Finite | str] = Field({}, description="values for the model's parameters, by name")
    zones: Annotated[tuple[ZoneShape, ...], Strict(False)] = Field(
        (), description="zones drawn here instead of a model"
    )
    cracks: Annotated[tuple[CrackShape, ...], Strict(False)] = Field((), description="cracks drawn here")
    edges: Annotated[tuple[EdgeShape, ...], Strict(False)] = Field((), description="names for block edges drawn here")
    joints: Annotated[tuple[JointShape, ...], Strict(False)] = Field((), description="joints that cut rock into blocks")
    joint_sets: Annotated[tuple[JointSetShape, ...], Strict(False)] = Field(
        (), description="joints by statistics, in order: later sets may end on those before"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the joint sets: the same seed, the same joints")
    section_azimuth_deg: Finite = Field(
        90.0, description="azimuth to which the section's x axis points, clockwise from north, degrees"
    )
    dead_ends: Literal["cracks", "trim"] = Field(
        "cracks", description='joints that stop in rock: "cracks" before a rock bridge, or "trim" them off'
    )
    shortest_crack_m: NotNegative = Field(0.0, description="dead ends shorter than this are trimmed, m")
    smallest_block_m2: NotNegative = Field(0.0, description="smaller blocks join a neighbour, m²")
    tolerance_m: Positive | None = Field(
        None, description="nearer than this, crack ends touch outlines and cracks, m (unset: 1e-6 of the largest side)"
    )
    chord_tolerance_m: Positive | None = Field(
        None, description="curved edges of a model become chords this near to it, m (unset: 1e-4 of the largest side)"
    )

    @model_validator(mode="after")
    def _one_source(self):
        if self.model is None and not self.zones:
            raise ValueError("no rock: give `model` (a Gmsh .geo file) or at least one [[geometry.zones]]")
        if self.model is not None and (self.zones or self.cracks or self.edges):
            raise ValueError(
                "give either `model` or [[geometry.zones]], [[geometry.cracks]], [[geometry.edges]], not both"
            )
        if self.model is None and self.parameters:
            raise ValueError("`parameters` belong to a Gmsh `model`; there is none")
        return self


class MaterialTable(Table):
    youngs_modulus_pa: Positive = Field(description="Young's modulus, Pa")
    poissons_ratio: Annotated[float, Field(gt=-1, lt=0.5)] = Field(description="Poisson's ratio")
    density_kg_m3: NotNegative = Field(description="density, kg/m³")
    k_ic_pa_sqrt_m: Positive | None = Field(
        None, description="fracture toughness in mode I, Pa √m; needed where cracks may grow"
    )
    k_iic_pa_sqrt_m: Positive | None = Field(
        None, description='toughness against growth in shear, Pa √m, for growth.criterion = "f" (unset: no such growth)'
    )
    tensile_strength_pa: Positive | None = Field(
        None, description="tensile strength of intact rock, Pa, for growth.initiation (unset: it does not tear)"
    )
    cohesion_pa: Positive | None = Field(
        None, description="cohesion of intact rock, Pa, for growth.initiation (unset: it does not shear)"
    )
    internal_friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] = Field(
        0.0, description="angle of internal friction of intact rock, beside its cohesion, degrees"
    )
    plane: Literal["strain", "stress"] = Field("strain", description='"strain" or "stress" in the plane')
    rigid: bool = Field(
        False,
        description="true: its blocks move without straining; the modulus sets the springs of their contacts only",
    )


class ZoneTable(Table):
    material: str | None = Field(None, description="a name of [materials] (unset: the only one there is)")
    fixed: bool = Field(False, description="true: its blocks do not move")
    guided: Literal["x", "y"] | None = Field(
        None,
        description='"x" or "y": its blocks move along that axis only and neither turn nor shear, as a press\'s platen',
    )


class JointTable(Table):
    friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] = Field(
        0.0, description="friction angle, degrees: that of the peak, with jrc the residual one"
    )
    cohesion_pa: NotNegative = Field(0.0, description="cohesion, Pa, until the joint slips or parts")
    tensile_strength_pa: NotNegative = Field(0.0, description="tensile strength, Pa, until the joint slips or parts")
    residual_friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] | None = Field(
        None, description="friction angle after slip, degrees (unset: as before)"
    )
    residual_cohesion_pa: NotNegative = Field(0.0, description="cohesion after slip, Pa, of faces that have not parted")
    softening_slip_m: NotNegative = Field(
        0.0, description="slip over which friction and cohesion fall to their residual values, m (0: at once)"
    )
    dilation_angle_deg: Annotated[float, Field(ge=0, lt=90)] = Field(
        0.0, description="angle at which sliding faces rise on each other, degrees"
    )
    dilation_slip_m: Positive | None = Field(
        None, description="slip from the start after which they rise no more, m (unset: they go on)"
    )
    jrc: Annotated[float, Field(gt=0, le=20)] | None = Field(
        None, description="joint roughness coefficient of Barton and Bandis (unset: straight Coulomb friction)"
    )
    jcs_pa: Positive | None = Field(None, description="compressive strength of the joint's wall, Pa, with jrc")
    joint_length_m: Positive | None = Field(
        None, description="length to which jrc and jcs_pa are corrected, m: of the joint's blocks (unset: the sample's)"
    )
    sample_length_m: Positive = Field(0.1, description="length of the sample that jrc and jcs_pa are of, m")
    stiffness_from_peak_slip: bool = Field(
        False, description="true: shear stiffness of a rough joint from its strength and the slip of its peak"
    )
    normal_stiffness_pa_per_m: Positive | None = Field(
        None, description="normal stiffness, Pa/m (unset: the solver's penalty springs)"
    )
    shear_stiffness_pa_per_m: Positive | None = Field(
        None, description="shear stiffness, Pa/m (unset: the solver's penalty springs)"
    )
    max_closure_m: Positive | None = Field(
        None,
        description="closure that a joint tends to, m: it stiffens hyperbolically from normal_stiffness_pa_per_m on",
    )
    edges: Names = Field(
        (),
        description='contacts where either edge has one of these names; "*" matches anything, "crack:NAME" is a '
        "face that a crack's growth has made",
    )
    between: Annotated[tuple[Annotated[tuple[str, str], Strict(False)], ...], Strict(False)] = Field(
        (), description="contacts between these pairs of edge names, [[a, b], …]; goes before `edges`"
    )


class CrackTable(Table):
    aperture: float | str = Field(
        "closed", description='"closed", "slot" (its faces never meet) or the initial aperture in m'
    )
    joint: str | None = Field(
        None, description="a name of [joints] whose law its faces follow, its wings with friction only (unset: smooth)"
    )

    @field_validator("aperture", mode="before")
    @classmethod
    def _known(cls, value: Any) -> Any:
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if value in ("closed", "slot") or (number and 0 <= value < float("inf")):
            return value
        raise ValueError(f'the aperture is "closed", "slot" or a length in m, not {value!r}')


class _Timed(Table):
    """A vector in time: exactly one of value, rate, times with values, or a file; a value may swing."""

    start_s: NotNegative = Field(0.0, description="the rate, or the sinusoid, counts from this time, s")
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
    direction: Pair | None = Field(None, description="[x, y] that a record with one column of values is multiplied by")
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
            if values is None or self.times_s is None or len(values) != len(self.times_s) or not values:
                raise ValueError(f"`times_s` and `{names[2]}` need the same number of entries, at least one")
            if any(b <= a for a, b in zip(self.times_s[:-1], self.times_s[1:])):
                raise ValueError("`times_s` must ascend")
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
    start: Pair = Field(description="one point of the line along which the traction varies, [x, y], m")
    end: Pair = Field(description="the other, [x, y], m")
    factors: Pair = Field(description="what the traction is multiplied by at the two points, linear between and beyond")

    @model_validator(mode="after")
    def _two_points(self):
        if self.start == self.end:
            raise ValueError("`start` and `end` are the same point")
        return self


class TractionTable(_Timed):
    edge: str = Field(description="name of the edges it acts on")
    follower: bool = Field(False, description="true: it turns with its block (unset: it keeps its direction)")
    profile: ProfileTable | None = Field(None, description="linear distribution along the edges (unset: uniform)")
    value_pa: Pair | None = Field(None, description="constant traction [x, y], Pa")
    rate_pa_per_s: Pair | None = Field(None, description="traction that grows from zero, [x, y], Pa/s")
    values_pa: Points | None = Field(None, description="tractions [[x, y], …] at `times_s`, Pa")

    def _parts(self):
        return self.value_pa, self.rate_pa_per_s, self.values_pa, ("value_pa", "rate_pa_per_s", "values_pa")


class ForceTable(_Timed):
    at: Pair = Field(description="material point it acts on, [x, y], m")
    zone: str | None = Field(None, description="zone of that point, where two zones touch")
    follower: bool = Field(False, description="true: it turns with its block (unset: it keeps its direction)")
    value_n_per_m: Pair | None = Field(None, description="constant force [x, y] per metre of thickness, N/m")
    rate_n_per_m_s: Pair | None = Field(None, description="force that grows from zero, [x, y], N/m per s")
    values_n_per_m: Points | None = Field(None, description="forces [[x, y], …] at `times_s`, N/m")

    def _parts(self):
        names = ("value_n_per_m", "rate_n_per_m_s", "values_n_per_m")
        return self.value_n_per_m, self.rate_n_per_m_s, self.values_n_per_m, names


class ViscousBoundaryTable(Table):
    edge: str = Field(description="name of the edges that let waves out (dynamic runs)")
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
            if len(self.times_s) != len(self.incoming_m_per_s) or not self.times_s:
                raise ValueError("`times_s` and `incoming_m_per_s` need the same number of entries, at least one")
            if any(b <= a for a, b in zip(self.times_s[:-1], self.times_s[1:])):
                raise ValueError("`times_s` must ascend")
        return self


class MotionTable(_Timed):
    zone: str = Field(description="zone whose blocks are moved, fixed ones too")
    axes: Literal["x", "y", "xy"] = Field("xy", description="components that are given; the others stay free")
    turns: bool = Field(False, description="true: the blocks may turn (unset: they keep their direction)")
    displacement_m: Pair | None = Field(None, description="constant displacement [x, y], m (an amplitude)")
    velocity_m_per_s: Pair | None = Field(None, description="velocity [x, y], m/s, from `start_s` on")
    displacements_m: Points | None = Field(None, description="displacements [[x, y], …] at `times_s`, m")

    def _parts(self):
        names = ("displacement_m", "velocity_m_per_s", "displacements_m")
        return self.displacement_m, self.velocity_m_per_s, self.displacements_m, names


class PointMotionTable(_Timed):
    at: Pair = Field(description="material point that is moved, [x, y], m")
    zone: str | None = Field(None, description="zone of that point, where two zones touch")
    axes: Literal["x", "y", "xy"] = Field("xy", description="components that are given; the others stay free")
    stiffness_n_per_m: Positive | None = Field(
        None, description="stiffness of the spring that moves it, N/m per metre of thickness (unset: exactly)"
    )
    displacement_m: Pair | None = Field(None, description="constant displacement [x, y], m (an amplitude)")
    velocity_m_per_s: Pair | None = Field(None, description="velocity [x, y], m/s, from `start_s` on")
    displacements_m: Points | None = Field(None, description="displacements [[x, y], …] at `times_s`, m")

    def _parts(self):
        names = ("displacement_m", "velocity_m_per_s", "displacements_m")
        return self.displacement_m, self.velocity_m_per_s, self.displacements_m, names


class BaseTable(_Timed):
    frame: Literal["ground", "base"] = Field(
        "ground",
        description='"ground": the fixed blocks move as the record says; "base": they stand, and blocks feel minus the '
        "acceleration",
    )
    baseline: Literal["", "constant", "linear"] = Field(
        "", description="baseline that is taken off a record or table so that the base comes to rest"
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
    points: Points = Field(description="the water table, [[x, y], …], m, x ascending, level beyond its ends")
    unit_weight_n_per_m3: Positive = Field(9810.0, description="unit weight of water, N/m³")
    dry_edges: Names = Field((), description="names of edges that no water reaches")
    level_times_s: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="times of `levels_m`, s, ascending"
    )
    levels_m: Annotated[tuple[Finite, ...], Strict(False)] | None = Field(
        None, description="by how much the whole table is raised at `level_times_s`, m"
    )

    @model_validator(mode="after")
    def _line(self):
        xs = [x for x, _ in self.points]
        if not xs or any(b <= a for a, b in itertools.pairwise(xs)):
            raise ValueError("`points` must be at least one, ascending in x")
        if (self.level_times_s is None) != (self.levels_m is None):
            raise ValueError("give `level_times_s` and `levels_m` together")
        if self.level_times_s is not None:
            if len(self.level_times_s) != len(self.levels_m) or not self.levels_m:
                raise ValueError("`level_times_s` and `levels_m` need the same number of entries, at least one")
            if any(b <= a for a, b in zip(self.level_times_s[:-1], self.level_times_s[1:])):
                raise ValueError("`level_times_s` must ascend")
        return self


class BoltTable(Table):
    name: str = Field("bolt", description="name of the bolt in history.csv")
    start: Pair = Field(description="its one end, a material point of a block, [x, y], m")
    end: Pair = Field(description="its other end, [x, y], m")
    zone: str | None = Field(None, description="zone of its one end, where two zones touch")
    end_zone: str | None = Field(None, description="zone of its other end, where two zones touch")
    end_in_ground: bool = Field(
        False, description="true: its other end is held by the ground at rest, whatever is there"
    )
    stiffness_n_per_m: Positive | None = Field(None, description="EA/L, N/m per metre of thickness")
    axial_stiffness_n: Positive | None = Field(
        None, description="EA of a fully grouted bar, N per metre of thickness; it works at every joint it crosses"
    )
    active_length_m: Positive | None = Field(
        None, description="length about a joint over which a grouted bar strains, m"
    )
    pretension_n_per_m: NotNegative = Field(0.0, description="force at installation, N/m")
    yield_force_n_per_m: Positive | None = Field(None, description="force at which it yields, N/m (unset: it does not)")
    breaking_strain: Positive | None = Field(None, description="strain at which it breaks (unset: it does not)")
    shear_stiffness_n_per_m: NotNegative = Field(0.0, description="stiffness across its axis (dowel), N/m")
    shear_strength_n_per_m: Positive | None = Field(
        None, description="force across its axis that it bears at most, N/m"
    )
    start_s: NotNegative = Field(0.0, description="time of its installation, s")
    compression: bool | None = Field(
        None, description="true: it takes compression too (unset: a grouted bar does, another goes slack)"
    )

    @model_validator(mode="after")
    def _one_kind(self):
        grouted = self.axial_stiffness_n is not None
        if grouted == (self.stiffness_n_per_m is not None):
            raise ValueError("give `stiffness_n_per_m`, or `axial_stiffness_n` of a grouted bar")
        if grouted != (self.active_length_m is not None):
            raise ValueError("`axial_stiffness_n` and `active_length_m` go together")
        if grouted and (self.end_in_ground or self.zone is not None or self.end_zone is not None):
            raise ValueError("a grouted bar finds its blocks itself: leave out `zone`, `end_zone` and `end_in_ground`")
        if self.start == self.end:
            raise ValueError("both ends of the bolt are the same point")
        if self.yield_force_n_per_m is not None and self.pretension_n_per_m > self.yield_force_n_per_m:
            raise ValueError("the pretension is beyond the yield force")
        return self


class ExcavationTable(Table):
    time_s: NotNegative = Field(description="when the blocks are taken out, s")
    zones: Names = Field((), description="zones whose blocks are taken out")
    polygon: Points | None = Field(None, description="blocks whose centroid lies in it are taken out, [[x, y], …], m")
    drained: bool = Field(True, description="true: no water presses any more on what lay against them")

    @model_validator(mode="after")
    def _something(self):
        if not self.zones and self.polygon is None:
            raise ValueError("give `zones` or a `polygon`")
        if self.polygon is not None and len(self.polygon) < 3:
            raise ValueError("a polygon has at least three points")
        return self


class InSituTable(Table):
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


class LoadsTable(Table):
    gravity_m_s2: Pair = Field((0.0, 0.0), description="acceleration of gravity [x, y], m/s²")
    gravity_ramp_s: NotNegative = Field(0.0, description="gravity grows linearly to its value over this time, s")
    leading_edge: str | None = Field(
        None,
        description="edges whose traction is the load of a run, positive in compression (unset: the first traction's)",
    )
    tractions: Annotated[tuple[TractionTable, ...], Strict(False)] = Field((), description="tractions on named edges")
    forces: Annotated[tuple[ForceTable, ...], Strict(False)] = Field((), description="forces on points")
    viscous_boundaries: Annotated[tuple[ViscousBoundaryTable, ...], Strict(False)] = Field(
        (), description="named edges that absorb waves, or let one in"
    )
    water: WaterTableTable | None = Field(None, description="water in all joints below a water table")
    base: BaseTable | None = Field(None, description="shaking of the base that the blocks stand on")
    motions: Annotated[tuple[MotionTable, ...], Strict(False)] = Field((), description="blocks whose motion is given")
    point_motions: Annotated[tuple[PointMotionTable, ...], Strict(False)] = Field(
        (), description="points whose motion is given"
    )
    bolts: Annotated[tuple[BoltTable, ...], Strict(False)] = Field((), description="bolts and anchors")
    excavations: Annotated[tuple[ExcavationTable, ...], Strict(False)] = Field(
        (), description="blocks that are taken out while the run goes on"
    )
    in_situ: InSituTable | None = Field(
        None, description="stress of the rock before the run; displacements count from its equilibrium"
    )

    @property
    def timed(self) -> list[tuple[tuple, _Timed]]:
        """Every load that is a function of time, with its place in the section."""
        lists = ("tractions", "forces", "motions", "point_motions")
        found = [((name, k), load) for name in lists for k, load in enumerate(getattr(self, name))]
        return found + ([(("base",), self.base)] if self.base is not None else [])


class DdaTable(Table):
    time_step_s: Positive = Field(1.0, description="longest time step, s")
    automatic_time_step: bool = Field(
        False,
        description="steps grow and shrink below `time_step_s` by displacement and open–close iterations",
    )
    dynamic_factor: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0, description="share of the velocity carried from step to step: 0 static, 1 dynamic"
    )
    damping: NotNegative = Field(
        0.4,
        description="damping of dynamic steps, as a fraction of the critical one of a block's lowest vibration (below 0.3 a "
        "block that should stick may creep; waves that cross many blocks want less)",
    )
    newmark: Pair = Field(
        (0.5, 1.0),
        description="β and γ of the time scheme: [0.5, 1] is Shi's, [0.25, 0.5] the trapezoidal rule without dissipation; "
        "2β ≥ γ ≥ 0.5",
    )
    spectral_radius: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None,
        description="in place of `newmark`: a second-order scheme that damps to this part a step what the step does not "
        "resolve; 1 not at all, 0 at once",
    )
    equilibrium: Literal["", "start", "loads"] = Field(
        "",
        description='when static equilibrium is sought, whatever the time step: "" never, "start" before the run begins, '
        '"loads" at every load of a static run too; a run ends where there is none',
    )
    unbalanced_tolerance: Positive = Field(
        1e-6, description="equilibrium: largest unbalanced force on a block, over the mean force on blocks"
    )
    rayleigh_fractions: Annotated[tuple[NotNegative, NotNegative], Strict(False)] | None = Field(
        None,
        description="Rayleigh damping of dynamic steps: fractions of the critical one at `rayleigh_frequencies_hz`, "
        "beside `damping`",
    )
    rayleigh_frequencies_hz: Annotated[tuple[Positive, Positive], Strict(False)] | None = Field(
        None, description="the two frequencies of `rayleigh_fractions`, Hz"
    )
    max_displacement_ratio: Annotated[float, Field(gt=0, le=1)] = Field(
        0.001, description="largest displacement in a step, in units of half the height of the domain"
    )
    normal_penalty_pa: Positive | None = Field(
        None,
        description="stiffness of normal contact springs, Pa (unset: from the stiffness of both blocks and the shape of the face)",
    )
    shear_penalty_pa: Positive | None = Field(
        None, description="stiffness of shear contact springs, Pa (unset: from the normal one)"
    )
    contact: Literal["penalty", "augmented"] = Field(
        "penalty",
        description='"penalty": springs hold the faces of blocks; "augmented": forces are added until they neither '
        "penetrate nor give, however soft the springs",
    )
    penetration_tolerance: Annotated[float, Field(gt=0, lt=1)] = Field(
        1e-8,
        description='what "augmented" contacts may still gape or give, in units of the smallest block\'s size, √area',
    )
    max_open_close_iterations: Annotated[int, Field(ge=1)] = Field(
        60, description="open–close iterations before the time step is cut"
    )
    max_step_cuts: Annotated[int, Field(ge=0)] = Field(12, description="how often a step is cut before the run fails")

    @field_validator("newmark")
    @classmethod
    def _stable(cls, value):
        beta, gamma = value
        if not 2 * beta >= gamma >= 0.5:
            raise ValueError(f"Newmark's β = {beta:g}, γ = {gamma:g} is not stable at every time step: 2β ≥ γ ≥ 0.5")
        return value

    @model_validator(mode="after")
    def _damped(self):
        if (self.rayleigh_fractions is None) != (self.rayleigh_frequencies_hz is None):
            raise ValueError("Rayleigh damping takes `rayleigh_fractions` and `rayleigh_frequencies_hz` together")
        if self.rayleigh_fractions is not None:
            rayleigh_coefficients(self.rayleigh_fractions, self.rayleigh_frequencies_hz)
        return self


class DdmTable(Table):
    target_error: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        None, description="relative error of K asked for; order, elements and grading then follow from it"
    )
    order: Annotated[int, Field(ge=0, le=10)] = Field(4, description="polynomial order of the elements")
    nodes: Literal["chebyshev", "gauss", "equal"] = Field("chebyshev", description="collocation points of an element")
    elements_per_crack: Annotated[int, Field(ge=1)] = Field(4, description="elements of a straight crack")
    elements_per_side: Annotated[int, Field(ge=1)] = Field(6, description="elements of a block's side")
    grading_ratio: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.3, description="ratio of neighbouring elements at kinks, junctions and mouths"
    )
    grading_layers: Annotated[int, Field(ge=0)] = Field(2, description="layers of that grading")
    solver: Literal["auto", "dense", "compressed"] = Field(
        "auto", description="how the cracks' equations are solved: factored, or iterated when they are many"
    )


class GrowthTable(Table):
    enabled: bool = Field(True, description="false: cracks open and slide, none grows")
    criterion: Literal["mts", "g", "s", "f"] = Field(
        "mts",
        description='growth criterion: "mts" maximum tangential stress, "g" maximum energy release rate, "s" minimum '
        'strain-energy density, "f" tension and shear, each against its own toughness',
    )
    increment_m: Positive | None = Field(
        None, description="longest advance of a tip in a cycle, m (unset: a tenth of the shortest crack)"
    )
    min_increment_m: Positive | None = Field(None, description="shortest advance, m (unset: a tenth of the longest)")
    join_distance: NotNegative = Field(
        0.5, description="nearer than this to a crack or a surface a tip joins it, in units of the increment"
    )
    max_passes: Annotated[int, Field(ge=1)] = Field(200, description="growth passes at one load")
    correct: bool = Field(
        True, description="predict each step, then bend it towards where it would go on: paths of second order"
    )
    initiation: Literal["", "surface", "everywhere"] = Field(
        "",
        description='where cracks are born when intact rock reaches its strength: "" nowhere, "surface" on outlines, '
        'holes and crack faces, "everywhere" inside blocks too',
    )
    initiation_distance_m: NotNegative = Field(
        0.0, description="stress is averaged over this distance into the rock, m (0: at the point)"
    )
    initiation_spacing_m: NotNegative = Field(
        0.0, description="least distance between cracks at birth, m (0: five increments)"
    )
    trial_kink_m: NotNegative = Field(
        0.0,
        description='length of the kinks that criterion "f" tries in all directions, faces in contact and with friction, m '
        "(0: kinks of no length, on which nothing presses; an increment or less sees shear cracks under compression)",
    )


class RunTable(Table):
    end_time_s: Positive = Field(description="the run ends at this time, s")
    stop_at: Annotated[
        tuple[Literal["initiation", "birth", "coalescence", "self", "daylighting", "split"], ...], Strict(False)
    ] = Field(("coalescence", "split"), description="the run ends at the first event of these kinds")
    boundary_stress: Literal["contacts"] = Field(
        "contacts",
        description='how contact forces become tractions on cracked blocks: "contacts", linear over each face',
    )


class GaugeTable(Table):
    start: Pair = Field(alias="from", description="one end of the axial strain gauge, [x, y], m")
    to: Pair = Field(description="its other end, [x, y], m")
    zone: str | None = Field(None, description="zone that carries it, where zones touch")


class MonitorTable(Table):
    name: str = Field(description="name of the monitor point in history.csv")
    at: Pair = Field(description="material point whose displacement is recorded, [x, y], m")
    zone: str | None = Field(None, description="zone of that point, where two zones touch")


class OutputTable(Table):
    every: Annotated[int, Field(ge=1)] = Field(
        1, description="write every n-th cycle; cycles with growth or an event, the first and the last always"
    )
    joints: bool | None = Field(
        None,
        description="write opening, slip and forces of every joint (joints.csv) and what fixed and guided blocks carry "
        "(reactions.csv) (unset: in scenes without cracks)",
    )
    interior: bool = Field(True, description="write stress inside cracked rock (interior.pvd)")
    interior_every: Annotated[int, Field(ge=1)] = Field(
        5,
        description="write the interior every n-th cycle while cracks grow, every 10 n-th while none does; at the first "
        "load, with events, before and after a block is cut and at the end always",
    )
    configuration: Literal["reference", "current"] = Field(
        "reference", description='coordinates in files: "reference" with displacement, or "current"'
    )


class RenderTable(Table):
    component: Literal["xx", "yy", "zz", "xy", "principal_max", "principal_min", "von_mises"] = Field(
        "yy", description="stress component that pictures show"
    )
    width_px: Annotated[int, Field(ge=64)] = Field(800, description="width of pictures, pixels")
    deformation_scale: NotNegative | None = Field(
        None, description="displacements are drawn this much larger (unset: so that they are seen)"
    )
    crack_colour: Literal["birth", "opening"] = Field("birth", description="what the colour of cracks means")
    gif: bool = Field(True, description="also make a moving picture of the growth")
    frames_per_second: Positive = Field(10.0, description="pace of the moving picture")


class SceneTables(Table):
    title: str = Field("", description="one line about the scene")
    geometry: Geometry = Field(description="what is where")
    materials: Annotated[dict[str, MaterialTable], Field(min_length=1)] = Field(description="materials by name")
    zones: dict[str, ZoneTable] = Field({}, description="what each zone of the geometry is made of, by its name")
    joints: dict[str, JointTable] = Field(
        {}, description="laws of contacts by name; `default` rules where none is named"
    )
    cracks: dict[str, CrackTable] = Field({}, description="cracks by name; `default` rules where none is named")
    loads: LoadsTable = Field(LoadsTable(), description="what acts on the blocks")
    dda: DdaTable = Field(DdaTable(), description="motion of the blocks")
    ddm: DdmTable = Field(DdmTable(), description="elements of cracked blocks")
    growth: GrowthTable = Field(GrowthTable(), description="growth of cracks")
    run: RunTable = Field(description="how long")
    gauge: GaugeTable | None = Field(None, description="axial strain between two points")
    monitors: Annotated[tuple[MonitorTable, ...], Strict(False)] = Field((), description="points that are recorded")
    output: OutputTable = Field(OutputTable(), description="files of a run")
    render: RenderTable = Field(RenderTable(), description="pictures of a run")
    variants: dict[str, dict[str, Any]] = Field(
        {}, description='named sets of changes: [variants.NAME] with "section.key" = value'
    )

    @field_validator("materials")
    @classmethod
    def _named(cls, value):
        if not value:
            raise ValueError("name at least one material: [materials.rock]")
        return value
