"""Grading of elements towards corners, kinks, junctions and mouths, where displacement is not smooth.

In a wedge of rock of angle α between free faces displacement varies like r^λ(α) (Williams 1952). With elements that
shrink by ``ratio`` from layer to layer, m layers leave a relative error A ratio^(λ m) in the stress intensity factors.
Either m is given, the same at every node, or it follows from the target error, with A(α) measured on kinks of 7° to
150°, notches and inclined mouths (`tests/validation/test_automatic.py` checks the resulting errors).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...model import DdmSettings

#: A kink turns by 20° or more, allowing for round-off, rad; kinks are graded.
KINK = math.radians(20) - 1e-9
#: Turns above this are sharp kinks, which stay graded as cracks grow.
SHARP_KINK = math.radians(60)
#: Relative error of K for which kinks get two layers; a factor of about two in the error is one layer. Further layers
#: depend on the kink's own exponent: 5e-4 at any angle (two layers for all left 3e-3 at 60°), the error of an ungraded
#: kink of 20°, the smallest that is graded.
KINK_ERROR, KINK_LAYERS = 5e-4, 2
#: Beyond this turn the faces of a folded crack nearly meet and take smaller elements: by a factor e for each of these
#: angles (without it, K of folds of 150° and 168° was off by 2e-3 and 2e-2, at targets up to 0.5).
FOLD, FOLD_SHRINKS = math.radians(120), math.radians(20 / 3)
#: Closed cracks are graded at turns above this, however slight. Slip past a kink would make one face enter the other,
#: so it varies like r to this power at any turn (0.36 to 0.45 from the effect of layers on kinks of 2° to 45°, 1 to
#: 0.01 of their crack); ungraded kinks leave this relative error of K, proportional to the turn up to the angle given
#: with it.
CLOSED_KINK, CLOSED_EXPONENT, CLOSED_ERROR, CLOSED_TURN = math.radians(5) - 1e-9, 0.41, 1.1e-2, math.radians(25)
#: Re-entrant corners of the outline with a crack within this many outline elements get the layers that leave this error
#: of K, unless no layers are wanted: half that of a kink, so that it adds little to what other corners leave.
NEAR_CORNER, CORNER_ERROR = 3.0, 0.5 * KINK_ERROR
#: An element of length h at a re-entrant corner leaves the error A (h/r)^λ of K in cracks at the distance r, with A this
#: value times (turn/90°)^1.5 up to right-angled corners and constant beyond. The crack counts as no farther away than
#: `CORNER_REACH` elements of the side. Measured at corners of 200° to 350°, tips and sides of cracks 0.02 to 1 crack
#: length away, three sizes of cracks, under tension and shear: A is 0.004, 0.012, 0.022, 0.04 at 200°, 220°, 240° and
#: 270°, and falls to 0.009 at 350° (`tests/ddm/mesh/test_corner_beside_crack.py`).
AT_CORNER, CORNER_REACH = 4e-2, 0.5
#: No element there is shorter than this part of the corner's distance from the origin: collocation points are rounded
#: (16 layers 2000 m from the origin left 7e-3, 12 layers 1e-4).
CORNER_FINEST = 1e-10
#: Most layers at any node; `Grading.finest` bounds the smallest element in any case.
MOST_LAYERS = 16
#: An element of length h at a distance r from the origin has an error 1e-13 r/h of K, because collocation points are
#: rounded; grading at a sharp kink of a segment L leaves an error ∝ √(h/L). The sum is least near h = 1e-7 r^⅔ L^⅓.
_FINEST = 1e-7
#: Shortest element relative to the extent, for any number of layers.
_SHORTEST = 1e-12

_ANGLES = np.radians(
    [45, 60, 75, 90, 105, 120, 135, 146, 150, 160, 170, 180, 190, 200, 210, 225, 240, 270, 300, 330, 360]
)
_EXPONENTS = np.array(
    [5.390, 4.059, 3.265, 2.740, 2.368, 2.094, 1.885, 1.763, 1.534, 1.288, 1.125, 1.0, 0.900, 0.819, 0.752, 0.674,
     0.616, 0.5445, 0.512, 0.5015, 0.5]
)  # fmt: skip


def exponent(angle: float) -> float:
    """Real part of the smallest exponent λ of a wedge of rock of ``angle`` (rad) between free faces.

    Rigid motions and λ = 1 excepted: roots of sin λα = ± λ sin α (Williams 1952), interpolated.
    """
    return float(np.interp(angle, _ANGLES, _EXPONENTS))


def ungraded(angle: float, where: str) -> tuple[float, float]:
    """Relative error of K caused by an ungraded wedge of rock of ``angle`` (rad), and the power of the element's length
    to which it is proportional (measured); ``where`` is "crack", "outline" or "mouth".

    It is larger at the outline, whose elements are long compared with their distance from a crack. Where one face of a
    wedge is loaded, the wedge rotates like r log r at any angle, except at right angles under a normal load.
    """
    turn = angle - math.pi
    if abs(turn) < 1e-6:
        return 0.0, 1.0
    if turn > 0:
        error = 2.4e-2 * (turn / (math.pi / 2)) ** 2.5
        return (error if where == "crack" else 4 * error), exponent(angle)
    if where == "crack" or abs(turn + math.pi / 2) < math.radians(1):
        return (1e-3 if angle > math.radians(100) else 1e-4), exponent(angle)
    return (1e-2 if where == "mouth" else 1e-3), 1.0


def at_graded_kink(turn: float) -> float:
    """Constant A of the error A ratio^(λ m) that m layers at a kink of ``turn`` (rad) leave in K.

    The kink is a tenth as long as its crack; the largest measured value (20° to 120°: within 30 %). Only the second and
    later layers reduce the error below that of `ungraded`.
    """
    return 2.4e-2 * (turn / (math.pi / 2)) ** 1.6


@dataclass(frozen=True)
class Grading:
    """``ratio`` of neighbouring layers; ``layers`` of them at each node, or as many as the ``target`` error
    requires."""

    ratio: float
    layers: int
    target: float | None = None

    @classmethod
    def of(cls, settings: DdmSettings) -> Grading:
        return cls(settings.grading_ratio, settings.grading_layers, settings.grading_error)

    def needed(self, angle: float, where: str) -> int:
        """Layers that reach the target at a wedge of rock of ``angle`` (rad); ``where`` as in `ungraded`."""
        error, power = ungraded(angle, where)
        if self.target is None or error <= self.target:
            return 0
        if where == "crack" and angle > math.pi:
            return self._at_kink(angle - math.pi, self.target)
        return self._layers_for(math.log(error / self.target) / power)

    def _at_kink(self, turn: float, error: float) -> int:
        """Layers that leave the relative error ``error`` at a kink of ``turn`` (rad)."""
        fold = max(0.0, (turn - FOLD) / FOLD_SHRINKS)
        return self._layers_for(math.log(max(at_graded_kink(turn) / error, 1.0)) / exponent(math.pi + turn) + fold)

    def _layers_for(self, shrinking: float) -> int:
        """Layers that shrink elements by exp(``shrinking``)."""
        return min(MOST_LAYERS, math.ceil(shrinking / -math.log(self.ratio)))

    def at_corner(self, angle: float) -> int:
        """Layers at a corner of the outline: re-entrant ones, which are singular, get all layers and one more, convex
        ones one, straight ones none."""
        if self.target is not None:
            return self.needed(angle, "outline")
        if angle > math.pi + KINK:
            return self.layers + 1
        return 1 if angle < math.pi - KINK and self.layers else 0

    def near_crack(self, angle: float, distance: float, reach: float) -> int:
        """Layers at a re-entrant corner of the outline near a crack; ``angle`` (rad) of rock. ``distance`` of the crack
        and ``reach``, the corner's largest coordinate, are in units of the side's elements."""
        if self.target is not None or not self.layers:
            return self.at_corner(angle)
        error = AT_CORNER * min(1.0, (angle - math.pi) / (math.pi / 2)) ** 1.5
        shrinking = math.log(error / CORNER_ERROR) / exponent(angle) - math.log(min(distance, CORNER_REACH))
        wanted = self._layers_for(max(shrinking, 0.0)) + self.layers - KINK_LAYERS
        most = min(MOST_LAYERS, math.floor(math.log(max(CORNER_FINEST * reach, 1e-300)) / math.log(self.ratio)))
        return max(self.at_corner(angle), min(wanted, most))

    def at_closed_kink(self, turn: float) -> int:
        """Layers at a kink of ``turn`` (rad) of a crack drawn closed; no fewer than at an open one."""
        if turn < CLOSED_KINK or (self.target is None and not self.layers):
            return self.at_kink(turn, False)
        error = CLOSED_ERROR * min(1.0, turn / CLOSED_TURN) / (KINK_ERROR if self.target is None else self.target)
        layers = self._layers_for(math.log(max(error, 1.0)) / CLOSED_EXPONENT)
        if self.target is None:
            layers = max(0, layers + self.layers - KINK_LAYERS)
        return max(layers, self.at_kink(turn, False))

    def at_kink(self, turn: float, forgotten: bool) -> int:
        """Layers at a crack's kink of ``turn`` (rad); none if it is ``forgotten``, i.e. left behind by growth, and not
        sharp."""
        if self.target is not None:
            return self.needed(math.pi + turn, "crack")
        if turn <= KINK or (forgotten and turn <= SHARP_KINK) or not self.layers:
            return 0
        return max(1, self._at_kink(turn, KINK_ERROR) + self.layers - KINK_LAYERS)

    def at_node(self, wedges: np.ndarray, where: str) -> int:
        """Layers at a junction ("crack") or, for the target, at a "mouth"; ``wedges`` (n,) are the angles of rock, rad.

        Without a target both get as many as a kink at their widest wedge, and no fewer than any other node. (A mouth has
        a wedge as wide only at a re-entrant corner of the outline.)
        """
        if self.target is None:
            return max(self.layers, self.at_kink(float(max(wedges, default=0.0)) - math.pi, False))
        return max((self.needed(float(angle), where) for angle in wedges), default=0)

    def finest(self, point: np.ndarray, length: float, extent: float) -> float:
        """Length, m, of the shortest element at ``point`` (2,) on an edge or segment of ``length``.

        ``extent`` is that of the body; farther from the origin than its extent, a body is graded as at its extent.
        """
        if self.target is None:
            return _SHORTEST * extent
        reach = min(max(abs(point[0]), abs(point[1])), extent)
        return max(_FINEST * reach ** (2 / 3) * length ** (1 / 3), _SHORTEST * extent)

    def fractions(self, layers: int, least: float = 0.0) -> list[float]:
        """Fractions inside (0, 1) that grade an element towards 0; no interval is shorter than ``least``."""
        return [f for f in (self.ratio**k for k in range(layers, 0, -1)) if f >= least]
