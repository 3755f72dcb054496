"""Location of rock, cracks and joints: [geometry]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from .entries import Finite, Four, Names, NotNegative, Pair, Points, Positive, Table


class ZoneShape(Table):
    """[[geometry.zones]]: rock drawn as polygons."""

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
    """[[geometry.cracks]]: a crack drawn as a line."""

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
    """[[geometry.edges]]: a named part of an outline."""

    name: str = Field(description='name for block edges, used by loads and joints ("load:top", "joint:bedding")')
    line: Annotated[tuple[Pair, Pair], Strict(False)] = Field(
        description="a straight piece, [[x, y], [x, y]], m: all block edges on it get the name"
    )
    zone: str | None = Field(None, description="name only edges of this zone (unset: of all zones)")


class JointShape(Table):
    """[[geometry.joints]]: a joint drawn as a line."""

    name: str = Field(description='name of the joints; the resulting block edges are called "joint:NAME"')
    points: Points = Field(description="a polyline along which rock is cut, [[x, y], …], m")
    zones: Names = Field((), description="names of the zones that it cuts (unset: all)")


DistributionLaw = Literal["constant", "normal", "uniform", "lognormal", "exponential"]


class JointSetShape(Table):
    """[[geometry.joint_sets]]: statistical joint sets."""

    name: str = Field(description='name of the set; the resulting block edges are called "joint:NAME"')
    kind: Literal["parallel", "poisson", "discs", "lines", "voronoi"] = Field(
        "parallel",
        description='"parallel" (spacing, length, gap), "poisson" (traces anywhere: p20), "discs" in space cut by the '
        'section (p32), endless "lines" (p21), edges of "voronoi" cells',
    )
    angle_deg: Finite | None = Field(
        None, description="angle of the traces from the horizontal, counter-clockwise, degrees"
    )
    angle_deviation_deg: NotNegative = Field(0.0, description="its standard deviation, degrees")
    angle_law: DistributionLaw = Field("normal", description="its law")
    dip_deg: Annotated[float, Field(ge=0, le=90)] | None = Field(
        None, description="dip of the joints in space, with `dip_direction_deg` in place of `angle_deg`, degrees"
    )
    dip_direction_deg: Finite | None = Field(None, description="azimuth of the dip, clockwise from north, degrees")
    fisher: NotNegative = Field(
        0.0, description="Fisher's constant of the poles in space about dip and dip direction (0: no scatter)"
    )
    spacing_m: Positive | None = Field(None, description='distance between the lines of a "parallel" set, m')
    spacing_deviation_m: NotNegative = Field(0.0, description="its standard deviation, m")
    spacing_law: DistributionLaw = Field("normal", description="its law")
    length_m: Positive | None = Field(
        None, description='length of traces, diameter of "discs", m (unset: right through the rock)'
    )
    length_deviation_m: NotNegative = Field(0.0, description="its standard deviation, m")
    length_law: DistributionLaw = Field("normal", description="its law")
    gap_m: NotNegative = Field(0.0, description='rock between the traces of one line of a "parallel" set, m')
    gap_deviation_m: NotNegative = Field(0.0, description="its standard deviation, m")
    gap_law: DistributionLaw = Field("normal", description="its law")
    p20_per_m2: Positive | None = Field(None, description='traces per area of a "poisson" set, 1/m²')
    p21_per_m: Positive | None = Field(None, description='length of "lines" per area, m/m²')
    p32_per_m: Positive | None = Field(None, description='area of "discs" per volume, m²/m³')
    cell_area_m2: Positive | None = Field(None, description='mean area of "voronoi" cells, m²')
    region: Points | None = Field(None, description="polygon that contains the set, [[x, y], …], m (unset: all rock)")
    zones: Names = Field((), description="names of the zones that the set cuts (unset: all)")
    ends_on: Names = Field((), description="names of earlier joints or sets at which its traces end")
    ends_share: Annotated[float, Field(ge=0, le=1)] = Field(1.0, description="fraction of the traces that do so")

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
        if self.fisher > 0 and not all(dips):
            raise ValueError("`fisher` spreads poles in space: it needs `dip_deg` and `dip_direction_deg`")
        if self.fisher > 0 and self.angle_deviation_deg > 0:
            raise ValueError("angles spread by `fisher` or by `angle_deviation_deg`, not by both")
        if self.kind == "discs" and not all(dips):
            raise ValueError('a set of kind "discs" needs `dip_deg` and `dip_direction_deg`')
        if self.kind in ("parallel", "poisson") and not all(dips) and self.angle_deg is None:
            raise ValueError(f'a set of kind "{self.kind}" needs `angle_deg`, or `dip_deg` and `dip_direction_deg`')
        if self.gap_m > 0 and (self.kind != "parallel" or self.length_m is None):
            raise ValueError('`gap_m` belongs to a "parallel" set with `length_m`')
        return self


Unit = Literal["m", "km", "cm", "mm", "ft", "in"]


class TraceFile(Table):
    """[[geometry.traces]]: a file of mapped traces."""

    file: str = Field(description="mapped traces, .dxf, .csv or .geojson, relative to the scene file")
    name: str | None = Field(
        None, description="name of the joints, or cracks, of all its layers (unset: layers' own names)"
    )
    kind: Literal["joint", "crack"] = Field(
        "joint", description='kind of its traces; layers called "zone-NAME", "bolt-NAME", "water", … have that kind'
    )
    layers: dict[str, str] = Field(
        {},
        description="kinds of its layers (or sets; with wildcards): "
        '{ "J1*" = "joint:bedding", "Rock" = "zone:rock" }, also "crack:", "hole", "edge:", "load:", '
        '"fixed", "bolt:", "water", "monitor:"; "" uses the layer\'s name; layers that match no entry are '
        "left out (unset: all are read)",
    )
    unit: Unit | None = Field(
        None, description="unit of its coordinates (unset: geometry.unit, else the unit in a DXF, else m)"
    )
    zones: Names = Field((), description="names of the zones that its joints cut (unset: all)")
    simplify_m: Positive | None = Field(
        None,
        description="vertices of its joints and cracks within this distance, m, of the line through the others are "
        "removed and reported; ends stay connected. Every side of a cracked block, and of a crack, needs "
        "at least one element (unset: lines as digitised)",
    )
    set_property: str = Field("set", description="property of GeoJSON features that names their set")


class Geometry(Table):
    """[geometry]: the drawing, and how it is cut into blocks."""

    model: str | None = Field(
        None,
        description="Gmsh model (.geo, .geo_unrolled, .msh, .step, .brep) or a mesh of another program (.inp, .bdf, .nas, .mesh, "
        ".su2, .vtk, .vtu), relative to the scene file",
    )
    parameters: dict[str, Finite | str] = Field({}, description="values for the model's parameters, by name")
    zones: Annotated[tuple[ZoneShape, ...], Strict(False)] = Field(
        (), description="zones drawn in the scene instead of a model"
    )
    cracks: Annotated[tuple[CrackShape, ...], Strict(False)] = Field((), description="cracks drawn in the scene")
    edges: Annotated[tuple[EdgeShape, ...], Strict(False)] = Field(
        (), description="names for block edges drawn in the scene"
    )
    joints: Annotated[tuple[JointShape, ...], Strict(False)] = Field((), description="joints that cut rock into blocks")
    traces: Annotated[tuple[TraceFile, ...], Strict(False)] = Field((), description="files with mapped traces")
    unit: Unit | None = Field(
        None,
        description="unit of the coordinates of the model and the traces (unset: that in DXF and STEP files, else m; "
        "Gmsh writes mm in every STEP file)",
    )
    origin: Pair | None = Field(
        None,
        description="world coordinates of the run's origin, [x, y], m: all coordinates here and in files are the "
        "world's (unset: [0, 0], or near the rock where it lies far away)",
    )
    joint_sets: Annotated[tuple[JointSetShape, ...], Strict(False)] = Field(
        (), description="statistical joint sets, in order: later sets may end on earlier ones"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the joint sets: the same seed, the same joints")
    section_azimuth_deg: Finite = Field(
        90.0, description="azimuth to which the section's x axis points, clockwise from north, degrees"
    )
    dead_ends: Literal["cracks", "trim"] = Field(
        "cracks",
        description='joints that end in rock: they become "cracks" in front of a rock bridge, or "trim" removes '
        "their ends (traces that vanish are reported)",
    )
    shortest_crack_m: NotNegative = Field(0.0, description="dead ends shorter than this are trimmed, m")
    smallest_block_m2: NotNegative | None = Field(
        None,
        description="smaller blocks are merged with a neighbour across the latest joint set, never across a drawn "
        "joint, m² (unset: a thousandth of the median block; 0: none)",
    )
    tolerance_m: Positive | None = Field(
        None,
        description="distance below which crack ends touch outlines and cracks, m (unset: 1e-6 of the largest side)",
    )
    chord_tolerance_m: Positive | None = Field(
        None,
        description="largest distance of the chords that replace curves of a model or DXF, and of ends of joints and "
        "cracks that are joined to a curve, m (unset: 1e-4 of the largest side)",
    )

    @model_validator(mode="after")
    def _one_source(self):
        if self.model is None and not self.zones and not self.traces:
            raise ValueError("no rock: give `model` (a Gmsh .geo file) or at least one [[geometry.zones]]")
        if self.model is not None and (self.zones or self.cracks or self.edges):
            raise ValueError(
                "give either `model` or [[geometry.zones]], [[geometry.cracks]], [[geometry.edges]], not both"
            )
        if self.model is None and self.parameters:
            raise ValueError("`parameters` belong to a Gmsh `model`; there is none")
        return self
