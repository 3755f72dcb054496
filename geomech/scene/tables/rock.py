"""Properties of rock, joints and crack faces: [materials], [zones], [joints], [cracks]."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict, field_validator, model_validator

from .entries import Names, NotNegative, Pair, Positive, Table


class MaterialTable(Table):
    """[materials.NAME]: a rock."""

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
        None, description="tensile strength of intact rock, Pa, for growth.initiation (unset: no initiation in tension)"
    )
    cohesion_pa: Positive | None = Field(
        None, description="cohesion of intact rock, Pa, for growth.initiation (unset: no initiation in shear)"
    )
    internal_friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] = Field(
        0.0, description="angle of internal friction of intact rock, used with its cohesion, degrees"
    )
    plane: Literal["strain", "stress"] = Field("strain", description='"strain" or "stress" in the plane')
    rigid: bool = Field(
        False,
        description="true: its blocks are rigid; the modulus only determines the springs of their contacts",
    )


class ZoneTable(Table):
    """[zones.NAME]: material and constraints of a zone."""

    material: str | None = Field(None, description="a name of [materials] (unset: the only one there is)")
    fixed: bool = Field(False, description="true: its blocks do not move")
    guided: Literal["x", "y"] | None = Field(
        None,
        description=(
            '"x" or "y": its blocks move along that axis only, without rotation or shear, like the platen of a press'
        ),
    )
    velocity_m_s: Pair | None = Field(
        None, description="velocity of its blocks at the start of a dynamic run, [x, y], m/s (unset: at rest)"
    )
    order: Annotated[int, Field(ge=1, le=8)] | Literal["auto"] = Field(
        1,
        description="order of the polynomial that is the displacement of each of its blocks, 1 to 8: 1 is uniform "
        'strain, from 2 on blocks bend, and the stress varies along their faces; "auto": each block '
        "begins with 1 and is raised where that matters (`dda.order_target`), with its cracks",
    )
    mesh_size_m: Positive | None = Field(
        None,
        description="its blocks are divided into cells of about this size, m, smaller at short edges of "
        "their outline; displacement and stress are continuous between cells. Needs an `order` of 2 or "
        "more (unset: a block is one cell)",
    )
    cells: Literal["triangles", "quads", "voronoi"] = Field(
        "triangles",
        description='shape of the cells of `mesh_size_m`: "triangles", "quads", or "voronoi", polygons around random points, '
        "such as grains (with `cell_joint`)",
    )
    crack_margin_m: Positive | None = Field(
        None,
        description="width of the rock around a crack, m, that is one cell, of order 8: the crack can grow inside it "
        "(unset: the length of the crack)",
    )
    cell_joint: str | None = Field(
        None,
        description="a name of [joints]: faces between cells separate where the stress reaches its tensile or shear "
        "strength, and have its friction from then on (unset: cells stay connected)",
    )
    body: Literal["block", "plane", "half-plane"] = Field(
        "block",
        description='"plane" or "half-plane": unbounded rock, of which the zone is the displayed part; its holes are '
        "holes, its outline has no meaning except for the edges called `surface` (cracks only, loaded by "
        "loads.remote and loads.fluids)",
    )
    surface: str | None = Field(None, description='name of the edges on the straight free surface of a "half-plane"')

    @model_validator(mode="after")
    def _one_surface(self):
        if self.body == "half-plane" and self.surface is None:
            raise ValueError('a "half-plane" needs `surface`, the name of the edges on its free surface')
        if self.mesh_size_m is not None and (self.fixed or self.guided is not None or self.body != "block"):
            raise ValueError("rock that is `fixed`, `guided` or unbounded is not divided: leave out `mesh_size_m`")
        if self.cell_joint is not None and self.mesh_size_m is None:
            raise ValueError("`cell_joint` needs cells: give `mesh_size_m`, or leave it out")
        if self.crack_margin_m is not None and self.mesh_size_m is None:
            raise ValueError("`crack_margin_m` needs cells: give `mesh_size_m`, or leave it out")
        if self.mesh_size_m is not None and self.order in (1, "auto"):
            raise ValueError(
                "cells need an order of 2 to 8, because uniformly strained ones are too stiff in bending: set order = 3"
            )
        if self.body != "half-plane" and self.surface is not None:
            raise ValueError('`surface` belongs to body = "half-plane"')
        if self.velocity_m_s is not None and (self.fixed or self.body != "block"):
            raise ValueError("rock that is `fixed` or unbounded has no `velocity_m_s`")
        across = 1 if self.guided == "x" else 0
        if self.guided is not None and self.velocity_m_s is not None and self.velocity_m_s[across] != 0:
            raise ValueError(f"a zone guided along {self.guided} cannot have an initial velocity across it")
        if self.body != "block" and (self.fixed or self.guided is not None):
            raise ValueError(f'unbounded rock (body = "{self.body}") is neither `fixed` nor `guided`')
        return self


class JointTable(Table):
    """[joints.NAME]: a joint law."""

    friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] = Field(
        0.0, description="friction angle, degrees: that of the peak, with jrc the residual one"
    )
    cohesion_pa: NotNegative = Field(
        0.0,
        description="cohesion, Pa, until the joint slips or opens: the shear strength of its faces is c l + N tan φ (`geomech safety` keeps it "
        "on faces that slip before others do, unless a residual strength is given)",
    )
    tensile_strength_pa: NotNegative = Field(
        0.0,
        description="tensile strength, Pa, until the joint slips or opens: a face breaks when its edge stress, N/l + "
        "6 M/l^2, reaches it",
    )
    residual_friction_angle_deg: Annotated[float, Field(ge=0, lt=90)] | None = Field(
        None, description="friction angle after slip, degrees (unset: as before)"
    )
    residual_cohesion_pa: NotNegative = Field(0.0, description="cohesion after slip, Pa, of faces that have not opened")
    softening_slip_m: NotNegative = Field(
        0.0, description="slip over which friction and cohesion fall to their residual values, m (0: at once)"
    )
    dilation_angle_deg: Annotated[float, Field(ge=0, lt=90)] = Field(0.0, description="dilation angle, degrees")
    dilation_slip_m: Positive | None = Field(None, description="slip after which dilation ends, m (unset: never)")
    jrc: Annotated[float, Field(gt=0, le=20)] | None = Field(
        None, description="joint roughness coefficient of Barton and Bandis (unset: linear Coulomb friction)"
    )
    jcs_pa: Positive | None = Field(None, description="compressive strength of the joint's wall, Pa, with jrc")
    joint_length_m: Positive | None = Field(
        None, description="length to which jrc and jcs_pa are corrected, m: of the joint's blocks (unset: the sample's)"
    )
    sample_length_m: Positive = Field(0.1, description="length of the sample of jrc and jcs_pa, m")
    stiffness_from_peak_slip: bool = Field(
        False, description="true: shear stiffness of a rough joint from its strength and its peak slip"
    )
    normal_stiffness_pa_per_m: Positive | None = Field(
        None,
        description="normal stiffness, Pa/m, against closure and rotation (unset: the solver's penalty springs)",
    )
    shear_stiffness_pa_per_m: Positive | None = Field(
        None, description="shear stiffness, Pa/m (unset: the solver's penalty springs)"
    )
    max_closure_m: Positive | None = Field(
        None,
        description="maximum closure, m: the joint stiffens hyperbolically from normal_stiffness_pa_per_m on",
    )
    crushing_strength_pa: Positive | None = Field(
        None,
        description="largest normal stress of faces, Pa: they close further under it, irreversibly; corners that touch away "
        "from a face have no area and no limit (unset: no limit)",
    )
    restitution: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None,
        description="coefficient of restitution of impacts, 0 (plastic) to 1 (elastic), independent of the time "
        "step; for rockfall (unset: determined by springs and time scheme, which leave 0.5 to 0.75 of "
        "the energy)",
    )
    edges: Names = Field(
        (),
        description='contacts where either edge has one of these names; "*" matches anything, "crack:NAME" is a face '
        "made by the growth of a crack",
    )
    between: Annotated[tuple[Annotated[tuple[str, str], Strict(False)], ...], Strict(False)] = Field(
        (), description="contacts between these pairs of edge names, [[a, b], …]; takes precedence over `edges`"
    )


class CrackTable(Table):
    """[cracks.NAME]: faces of a crack."""

    aperture: float | str = Field(
        "closed", description='"closed", "slot" (its faces never meet) or the initial aperture in m'
    )
    joint: str | None = Field(
        None,
        description="a name of [joints] for the law of its faces; new growth has friction only (unset: smooth; without an "
        "entry, ends of joints in rock follow the law of their joint, which may be the default)",
    )

    @field_validator("aperture", mode="before")
    @classmethod
    def _known(cls, value: Any) -> Any:
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if value in ("closed", "slot") or (number and 0 <= value < float("inf")):
            return value
        raise ValueError(f'the aperture is "closed", "slot" or a length in m, not {value!r}')
