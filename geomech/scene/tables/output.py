"""Records and drawings of a run: [gauge], [[monitors]], [output], [render]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .entries import NotNegative, Pair, Positive, Table


class GaugeTable(Table):
    """[gauge]: two points between which strain is measured."""

    start: Pair = Field(alias="from", description="one end of the axial strain gauge, [x, y], m")
    to: Pair = Field(description="its other end, [x, y], m")
    zone: str | None = Field(None, description="zone that carries it, where zones touch")


class MonitorTable(Table):
    """[[monitors]]: a point whose displacement is recorded."""

    name: str = Field(description="name of the monitor point in history.csv")
    at: Pair | None = Field(
        None,
        description='material point whose displacement is recorded, [x, y], m (unset: the drawn point "monitor:NAME")',
    )
    zone: str | None = Field(None, description="zone of that point, where two zones touch")


class OutputTable(Table):
    """[output]: files of a run."""

    every: Annotated[int, Field(ge=1)] = Field(
        1, description="write every n-th cycle; cycles with growth or an event, the first and the last always"
    )
    joints: bool | None = Field(
        None,
        description="write opening, slip and forces of every joint (joints.csv) and the reactions of fixed and "
        "guided blocks (reactions.csv) (unset: in scenes without cracks)",
    )
    interior: bool = Field(True, description="write stress inside cracked rock (interior.pvd)")
    interior_every: Annotated[int, Field(ge=1)] = Field(
        5,
        description="write the interior every n-th cycle while cracks grow, every 10n-th otherwise; always at the "
        "first load, with events, before and after a block is cut and at the end (in motion with 8 or more cracked "
        "blocks ten times less often, at the first load and at the end)",
    )
    checkpoint_every: Annotated[int, Field(ge=0)] | None = Field(
        None,
        description="write a checkpoint for `geomech resume` every n cycles, 0 never (unset: every half minute, less "
        "often if that takes more than a fiftieth of the time); if not 0, also at the end and after "
        "Ctrl-C",
    )
    checkpoint_kept_mb: NotNegative = Field(
        16.0,
        description="largest checkpoint that a finished run keeps, to be continued beyond its end, MB; a stopped or "
        "failed run keeps its checkpoint at any size",
    )
    format: Literal["vtu", "vtkhdf"] = Field(
        "vtu",
        description='series as "vtu" (one file per cycle, listed by .pvd) or as "vtkhdf" (one file per series, '
        "blocks.vtkhdf and so on; needs h5py and ParaView 5.13 or newer)",
    )
    configuration: Literal["reference", "current"] = Field(
        "reference",
        description='coordinates in files: "reference", to be warped by displacement, or "current", not to be warped',
    )


class RenderTable(Table):
    """[render]: appearance of pictures."""

    component: Literal["xx", "yy", "zz", "xy", "principal_max", "principal_min", "von_mises"] = Field(
        "yy", description="stress component in pictures"
    )
    width_px: Annotated[int, Field(ge=64)] = Field(800, description="width of pictures, pixels")
    deformation_scale: NotNegative | None = Field(
        None,
        description="factor on displacements in pictures (unset: chosen to make them visible without overlapping "
        "blocks)",
    )
    crack_colour: Literal["birth", "opening"] = Field("birth", description="meaning of the colour of cracks")
    gif: bool = Field(True, description="also make a movie of the growth")
    frames_per_second: Positive = Field(10.0, description="frame rate of the movie")
