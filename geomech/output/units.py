"""Readable units: kPa for the loads of a slope, MPa for those of a specimen; metres, millimetres or microns."""

from __future__ import annotations

import math

import numpy as np

#: (smallest value for which it is used, unit, size of the unit)
STRESSES = ((1e5, "MPa", 1e6), (1e2, "kPa", 1e3), (0.0, "Pa", 1.0))
LENGTHS = ((1.0, "m", 1.0), (1e-4, "mm", 1e-3), (0.0, "µm", 1e-6))


def stress_unit(largest: float) -> tuple[str, float]:
    """(name, Pa) of the unit for stresses up to ``largest`` (Pa); MPa if it is 0."""
    return _unit(STRESSES, largest)


def length_unit(largest: float) -> tuple[str, float]:
    """(name, m) of the unit for lengths up to ``largest`` (m); m if it is 0."""
    return _unit(LENGTHS, largest)


def largest_of(values: np.ndarray) -> float:
    """The largest magnitude among ``values``, without nan; 0 for none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if len(finite) else 0.0


def stress_text(value: float, digits: int = 4) -> str:
    """Magnitude of a stress in Pa with ``digits`` digits and its unit."""
    name, size = stress_unit(value)
    return f"{_digits(abs(value) / size, digits)} {name}"


def length_text(value: float, digits: int = 3) -> str:
    """Length in m with ``digits`` digits and its unit."""
    name, size = length_unit(value)
    return f"{_digits(value / size, digits)} {name}"


def _digits(value: float, digits: int) -> str:
    """``value`` with ``digits`` digits, without an exponent; all digits before the point are kept."""
    before = 1 + math.floor(math.log10(abs(value))) if value else 1
    return f"{value:.{max(0, digits - max(before, 1))}f}"


def _unit(units: tuple[tuple[float, str, float], ...], largest: float) -> tuple[str, float]:
    size = abs(largest)
    if not (math.isfinite(size) and size > 0):
        return units[0][1:]
    return next((name, unit) for least, name, unit in units if size >= least)
