"""Common appearance of a run's pictures: colours, final cycle, magnification."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from geomech.output.reading import Run

from .overlaps import overlap
from .walls import Walls

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.colors import Colormap

#: Meaning of the colour of cracks → legend title.
CRACK_COLOURS = {"birth": "grown in cycle", "opening": "opening, µm"}

#: Size at which the largest displacement is drawn, relative to the block system.
DEFORMATION = 0.03
#: Blocks may overlap by this fraction of the size in a drawing: two pixels of a picture 800 wide.
OVERLAP = 0.0025


def rock_colours(low: float, high: float) -> Colormap:
    """Colours of rock for values from ``low`` to ``high``, also for the player.

    If both signs matter, red is positive, blue negative, white zero, equally deep for equal magnitude. Otherwise the
    map runs from light to dark, dark for the largest magnitude, so that a grey print is readable too.
    """
    import matplotlib
    from matplotlib.colors import ListedColormap

    if two_signed(low, high):
        # The outermost tenth of this map is nearly black on both sides.
        at = 0.5 + 0.45 * np.linspace(low, high, 256) / max(-low, high)
        return ListedColormap(matplotlib.colormaps["RdBu_r"](at))
    name = "YlGnBu" if low + high >= 0 else "YlGnBu_r"
    return ListedColormap(matplotlib.colormaps[name](np.linspace(0.04, 0.96, 256)))


def two_signed(low: float, high: float) -> bool:
    """Whether both signs matter: the smaller side is more than a tenth of the larger."""
    return low < 0 < high and min(-low, high) > 0.1 * max(-low, high)


def crack_colours() -> Colormap:
    """From crimson to orange: distinct from all colours of rock."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("crack", ["#8f0d33", "#d7263d", "#ff7a1a", "#ffb01f"])


def final_cycle(run: Run) -> int:
    """The cycle that shows the final state of a run: the last one, except where a run ends as its rock is cut.

    Then it is the last one with the cracks that cut it: the pieces have uniform stress, and their motion was not
    computed.
    """
    last = int(run.history["cycle"][-1])
    written = list(run.grids("blocks"))
    cracked = run.history[run.history["crack_length"] > 0]
    if not len(cracked) or run.history["crack_length"][-1] > 0 or len(written) < 2:
        return last
    before = cracked[-1]
    return int(before["cycle"]) if before["time"] == run.history["time"][-1] else last


def crack_limits(run: Run, cycle: int, colour: str) -> tuple[float, float]:
    """Range of crack colours up to ``cycle``: cycles, or µm of opening; (0, 0) if none has grown or no cracks were
    written.

    Raises KeyError for an unknown ``colour``.
    """
    if colour not in CRACK_COLOURS:
        raise KeyError(f"no crack colour {colour!r}; there are {', '.join(CRACK_COLOURS)}")
    if not run.series("cracks"):
        return 0.0, 0.0
    cracks = run.grid("cracks", cycle)
    if colour == "birth":
        walls = Walls.of(run)
        grown = np.concatenate([cracks["birth_cycle"], walls.birth[walls.cut < cycle]])
        grown = grown[grown > 0]
        return (float(grown.min()), float(grown.max())) if len(grown) else (0.0, 0.0)
    opening = np.abs(cracks["opening"][np.isfinite(cracks["opening"])]) * 1e6
    return (0.0, float(np.percentile(opening, 98))) if len(opening) else (0.0, 0.0)


def magnification(shown: Sequence[pv.UnstructuredGrid], size: float) -> float:
    """A round factor that makes displacements visible, with overlaps of blocks below the width of a line."""
    # A common translation shows nothing; relative motion counts, and cracked blocks deform more than their uniform
    # strain.
    spread = max(np.ptp(grid["displacement"], axis=0).max() for grid in shown)
    if spread <= 1e-12 * size:
        return 1.0
    scale = DEFORMATION * size / spread
    # Motion that is large enough to be visible is drawn true to scale.
    if scale <= 1:
        return 1.0
    scale = max(1.0, float(f"{scale:.1g}"))
    if overlap(shown, 1.0, OVERLAP * size):
        return scale  # not due to the factor
    while scale > 1.0 and overlap(shown, scale, OVERLAP * size):
        scale = max(1.0, float(f"{0.5 * scale:.1g}"))
    return scale
