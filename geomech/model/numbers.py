"""Admissible ranges of settings and constants: one table per class, checked when an object is made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np


class FieldError(ValueError):
    """A value that does not go with the others of its object; ``field`` is its name."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


@dataclass(frozen=True)
class Number:
    """A range of numbers from ``least`` to ``most``; nan is never in it.

    closed    True: ``least`` belongs to the range
    unit      for messages
    infinite  True: +∞ is admissible and means "no limit"
    whole     True: integers only
    optional  True: None is admissible and means "not given"
    """

    least: float = 0.0
    most: float = math.inf
    closed: bool = True
    unit: str = ""
    infinite: bool = False
    whole: bool = False
    optional: bool = False

    def holds(self, value: object) -> bool:
        if value is None:
            return self.optional
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
            return False
        if self.whole and not isinstance(value, (int, np.integer)):
            return False
        if math.isinf(value):
            return self.infinite and bool(value > 0)
        return bool(self.least <= value <= self.most and (self.closed or value > self.least))

    @property
    def requirement(self) -> str:
        """The requirement as words for a message, such as "must be positive"."""
        if self.whole:
            return f"must be a whole number of at least {self.least:g}"
        if self.most < math.inf:
            if self.closed:
                return f"must be from {self.least:g} to {self.most:g}"
            return f"must be more than {self.least:g} and at most {self.most:g}"
        if self.least == 0.0:
            return "must not be negative" if self.closed else "must be positive"
        return f"must be {'at least' if self.closed else 'more than'} {self.least:g}"


#: The range of positive numbers.
POSITIVE = Number(closed=False)


def refuse_numbers(of: object, table: Mapping[str, Number], subject: str = "") -> None:
    """Check the attributes of ``of`` that ``table`` names against their ranges.

    Raises ValueError that names ``subject``, the attribute and its value, for the first one outside its range."""
    for name, number in table.items():
        value = getattr(of, name)
        if number.holds(value):
            continue
        finite = isinstance(value, (float, np.floating)) and math.isinf(value) and value > 0 and number.most == math.inf
        requirement = f"{number.requirement} and finite" if finite else number.requirement
        raise ValueError(
            f"{f'{subject}: ' if subject else ''}{name} {requirement}, got {as_text(value)} {number.unit}".rstrip()
        )


def as_text(value: object) -> str:
    """``value`` as text for a message: NumPy scalars without their type."""
    return repr(value.item() if isinstance(value, np.generic) else value)


def refuse_point(what: str, point: Any) -> None:
    """Raise ValueError that begins with ``what`` unless ``point`` is two finite coordinates."""
    if np.shape(point) != (2,) or not np.isfinite(np.asarray(point, dtype=float)).all():
        raise ValueError(f"{what} needs two finite coordinates (x, y) in m, got {point!r}")
