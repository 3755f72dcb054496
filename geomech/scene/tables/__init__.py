"""The tables of a scene file: every key is declared, bounded and described here, once."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, Strict, field_validator

from .entries import FolderName, Table
from .geometry import Geometry
from .loads import LoadsTable
from .output import GaugeTable, MonitorTable, OutputTable, RenderTable
from .rock import CrackTable, JointTable, MaterialTable, ZoneTable
from .solvers import DdaTable, DdmTable, GrowthTable, RunTable
from .sweep import SweepTable

__all__ = ["SceneTables"]


class SceneTables(Table):
    """A whole scene."""

    title: str = Field("", description="title, one line")
    geometry: Geometry = Field(description="geometry")
    materials: Annotated[dict[str, MaterialTable], Field(min_length=1)] = Field(description="materials by name")
    zones: dict[str, ZoneTable] = Field({}, description="what each zone of the geometry is made of, by its name")
    joints: dict[str, JointTable] = Field({}, description="joint laws by name; `default` applies where none is named")
    cracks: dict[str, CrackTable] = Field({}, description="cracks by name; `default` applies where none is named")
    loads: LoadsTable = Field(LoadsTable(), description="loads on the blocks")
    dda: DdaTable = Field(DdaTable(), description="motion of the blocks")
    ddm: DdmTable = Field(DdmTable(), description="elements of cracked blocks")
    growth: GrowthTable = Field(GrowthTable(), description="growth of cracks")
    run: RunTable = Field(description="duration of a run, its steps, and what ends it")
    gauge: GaugeTable | None = Field(None, description="axial strain between two points")
    monitors: Annotated[tuple[MonitorTable, ...], Strict(False)] = Field((), description="points that are recorded")
    output: OutputTable = Field(OutputTable(), description="files of a run")
    render: RenderTable = Field(RenderTable(), description="pictures of a run")
    sweep: SweepTable | None = Field(None, description="many runs of the scene, for `geomech sweep`")
    variants: dict[FolderName, dict[str, Any]] = Field(
        {},
        description='named sets of changes: [variants.NAME] with "section.key" = value; NAME becomes the name of a run '
        "folder",
    )

    @field_validator("materials")
    @classmethod
    def _named(cls, value):
        if not value:
            raise ValueError("name at least one material: [materials.rock]")
        return value
