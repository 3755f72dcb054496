"""Root of an expensive, nearly linear function: secants, then the Illinois rule (Dowell & Jarratt 1971)."""

from __future__ import annotations

import math

#: Points that may leave the interval longer than half of its former length.
_PATIENCE = 3


class Crossing:
    """The root of a rising function, from points added one at a time.

    Secants until two points enclose the root; then the Illinois rule, which keeps it enclosed, or bisection where three
    points have not halved the interval. ``slope``: that of the last two points, initially a guess.
    """

    def __init__(self, slope: float) -> None:
        self.slope = slope
        self._low: tuple[float, float] | None = None
        self._high: tuple[float, float] | None = None
        self._last: tuple[float, float] | None = None
        self._side = 0
        self._halved_at, self._since = math.inf, 0

    def add(self, at: float, value: float) -> None:
        """Add the point (``at``, ``value``)."""
        if self._last is not None and at != self._last[0]:
            self.slope = (value - self._last[1]) / (at - self._last[0])
        self._last = at, value
        side = -1 if value < 0 else 1
        if side < 0:
            self._low = at, value
        else:
            self._high = at, value
        if side == self._side and self._low is not None and self._high is not None:
            # The same end has stayed twice: half its value moves the next point across the root.
            if side < 0:
                self._high = self._high[0], 0.5 * self._high[1]
            else:
                self._low = self._low[0], 0.5 * self._low[1]
        self._side = side
        if self.width <= 0.5 * self._halved_at:
            self._halved_at, self._since = self.width, 0
        elif self.enclosed:
            self._since += 1

    @property
    def enclosed(self) -> bool:
        return self._low is not None and self._high is not None

    @property
    def width(self) -> float:
        """Length of the interval that contains the root; infinite until there is one."""
        if self._low is None or self._high is None:
            return math.inf
        return abs(self._high[0] - self._low[0])

    @property
    def next(self) -> float:
        """The next trial point; infinite where the last points show no root ahead. Raises ValueError without points."""
        if self._low is not None and self._high is not None:
            (a, f), (b, g) = self._low, self._high
            if self._since >= _PATIENCE:
                return 0.5 * (a + b)
            return a - f * (b - a) / (g - f)
        if self._last is None:
            raise ValueError("the search for a root needs at least one point")
        at, value = self._last
        return at - value / self.slope if self.slope > 0 else math.copysign(math.inf, -value)
