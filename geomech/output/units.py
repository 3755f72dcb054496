"""Units in which a number is easily read: kPa for a slope's loads, MPa for a specimen's; metres, millimetres or
microns."""

from __future__ import annotations

import math

import numpy as np

#: (smallest value that it is for, unit, size of the unit)
STRESSES = ((1e5, "MPa", 1e6), (1e2, "kPa", 1e3), (0.0, "Pa", 1.0))
LENGTHS = ((1.0, "m", 1.0), (1e-4, "mm", 1e-3), (0.0, "µm", 1e-6))


def stress_unit(largest: float) -> tuple[str, float]:
    """(name, Pa) of the unit for stresses of which the ``largest``, Pa, is of this size; MPa where there is none."""
    return _unit(STRESSES, largest)


def length_unit(largest: float) -> tuple[str, float]:
    """(name, m) of the unit for lengths of which the ``largest``, m, is of this size; m where there is none."""
    return _unit(LENGTHS, largest)


def largest_of(values: np.ndarray) -> float:
    """The largest magnitude among ``values``, nan left out; 0 of none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if len(finite) else 0.0


def stress_text(value: float, digits: int = 4) -> str:
    """The magnitude of a stress in Pa, in so many digits, with its unit."""
    name, size = stress_unit(value)
    return f"{_digits(abs(value) / size, digits)} {name}"


def length_text(value: float, digits: int = 3) -> str:
    """A length in m, in so many digits, with its unit."""
    name, size = length_unit(value)
    return f"{_digits(value / size, digits)} {name}"


def _digits(value: float, digits: int) -> str:
    """``value`` with so many digits, those before the point all of them, without an exponent."""
    before = 1 + math.floor(math.log10(abs(value))) if value else 1
    return f"{value:.{max(0, digits - max(before, 1))}f}"


def _unit(units: tuple[tuple[float, str, float], ...], largest: float) -> tuple[str, float]:
    size = abs(largest)
    if not (math.isfinite(size) and size > 0):
        return units[0][1:]
    return next((name, unit) for least, name, unit in units if size >= least)
