"""Where a function that is costly, and nearly linear, passes zero."""

from __future__ import annotations

import math

#: Points that may leave an interval longer than half of what it was.
_PATIENCE = 3


class Crossing:
    """The zero of a rising function, sought from points that are added one by one: secants until two points lie on
    either side of it, then the Illinois rule (Dowell & Jarratt 1971), which keeps it between them, or half their
    interval where that has not halved it in three points.

    ``slope`` is that of the last two points, before there are two a guess.
    """

    def __init__(self, slope: float) -> None:
        self.slope = slope
        self._low: tuple[float, float] | None = None
        self._high: tuple[float, float] | None = None
        self._last: tuple[float, float] | None = None
        self._side = 0
        self._halved_at, self._since = math.inf, 0

    def add(self, at: float, value: float) -> None:
        """The function has ``value`` at ``at``."""
        if self._last is not None and at != self._last[0]:
            self.slope = (value - self._last[1]) / (at - self._last[0])
        self._last = at, value
        side = -1 if value < 0 else 1
        if side < 0:
            self._low = at, value
        else:
            self._high = at, value
        if side == self._side and self.enclosed:
            # The far end has stayed: half its value draws the next point over the zero.
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
        """Of the interval that holds the zero; infinite while none does."""
        return abs(self._high[0] - self._low[0]) if self.enclosed else math.inf

    @property
    def next(self) -> float:
        """Where to look next; infinite where the last points leave no zero ahead. Raises ValueError before there is
        one."""
        if self.enclosed:
            (a, f), (b, g) = self._low, self._high
            if self._since >= _PATIENCE:
                return 0.5 * (a + b)
            return a - f * (b - a) / (g - f)
        if self._last is None:
            raise ValueError("a crossing is sought from at least one point")
        at, value = self._last
        return at - value / self.slope if self.slope > 0 else math.copysign(math.inf, -value)
