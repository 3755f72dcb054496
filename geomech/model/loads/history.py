"""Functions of time: piecewise linear, ramps, sinusoids, records from a file, with their exact integrals."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

#: Units of columns of a record and their factors to SI. Standard gravity is 9.80665 m/s² (ISO 80000-3),
#: 1 gal = 1 cm/s².
UNITS = {
    "s": 1.0,
    "ms": 1e-3,
    "min": 60.0,
    "h": 3600.0,
    "d": 86400.0,
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "m/s": 1.0,
    "cm/s": 1e-2,
    "mm/s": 1e-3,
    "m/s2": 1.0,
    "cm/s2": 1e-2,
    "mm/s2": 1e-3,
    "gal": 1e-2,
    "g": 9.80665,
    "pa": 1.0,
    "kpa": 1e3,
    "mpa": 1e6,
    "gpa": 1e9,
    "n": 1.0,
    "kn": 1e3,
    "mn": 1e6,
    "n/m": 1.0,
    "kn/m": 1e3,
    "mn/m": 1e6,
    "rad": 1.0,
    "deg": math.pi / 180,
    "-": 1.0,
    "": 1.0,
}
_TIMES = ("s", "ms", "min", "h", "d", "")


@dataclass(frozen=True, eq=False)
class Wave:
    """A sinusoid: ``amplitude`` (k,) · sin(2π ``frequency`` (t − ``start``) + ``phase``) from ``start`` to ``end``.

    Zero elsewhere. Times s, frequency Hz, phase rad."""

    amplitude: np.ndarray
    frequency: float
    phase: float = 0.0
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.frequency) and self.frequency > 0):
            raise ValueError(f"a sinusoid needs a positive frequency, got {self.frequency!r} Hz")
        if not (math.isfinite(self.phase) and math.isfinite(self.start) and np.isfinite(self.amplitude).all()):
            raise ValueError("a sinusoid has an amplitude, a phase or a start that is not finite")
        if not self.end > self.start:
            raise ValueError(f"a sinusoid must end after it starts, got {self.start!r} to {self.end!r} s")

    def at(self, time: float) -> np.ndarray:
        if not self.start <= time <= self.end:
            return np.zeros_like(self.amplitude)
        return self.amplitude * math.sin(2 * math.pi * self.frequency * (time - self.start) + self.phase)

    def integrals(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """First and second time integral of the wave from −∞ to ``time``."""
        omega, phase = 2 * math.pi * self.frequency, self.phase
        x = min(max(time - self.start, 0.0), self.end - self.start)
        once = (math.cos(phase) - math.cos(omega * x + phase)) / omega
        twice = (x * math.cos(phase) - (math.sin(omega * x + phase) - math.sin(phase)) / omega) / omega
        twice += once * max(time - self.end, 0.0)
        return self.amplitude * once, self.amplitude * twice


@dataclass(frozen=True, eq=False)
class History:
    """A piecewise linear function of time, constant beyond its ends, plus a sinusoid.

    times   (n,) s, ascending
    values  (n, k)
    rate    (k,) per second: slope after the last time; None: constant
    wave    added sinusoid; None: none

    Raises ValueError for times that do not ascend, and for values that are not finite or not as many.

    >>> load = History(np.array([0.0, 10.0]), np.array([[0.0, 0.0], [0.0, -2e6]]))
    >>> load.at(5.0).tolist()
    [0.0, -1000000.0]
    """

    times: np.ndarray
    values: np.ndarray
    rate: np.ndarray | None = None
    wave: Wave | None = None

    def __post_init__(self) -> None:
        times, values = np.asarray(self.times, dtype=float), np.asarray(self.values, dtype=float)
        if times.ndim != 1 or values.ndim != 2 or len(times) != len(values) or not len(times):
            raise ValueError(f"a history needs times (n,) and values (n, k), got {times.shape} and {values.shape}")
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise ValueError("a history has times or values that are not finite")
        for what, more in (("rate", self.rate), ("wave", None if self.wave is None else self.wave.amplitude)):
            if more is not None and not (np.shape(more) == values.shape[1:] and np.isfinite(more).all()):
                raise ValueError(f"the {what} of a history needs {values.shape[1]} finite numbers, got {more!r}")
        if (np.diff(times) <= 0).any():
            at = int(np.argmax(np.diff(times) <= 0))
            raise ValueError(f"the times of a history must increase: {times[at + 1]:g} s follows {times[at]:g} s")

    @classmethod
    def constant(cls, value: ArrayLike) -> History:
        return cls(np.zeros(1), np.atleast_2d(np.asarray(value, dtype=float)))

    @classmethod
    def ramp(cls, rate: ArrayLike, start: float = 0.0) -> History:
        """Zero until ``start`` s, then growing at ``rate`` per second."""
        rate = np.atleast_1d(np.asarray(rate, dtype=float))
        return cls(np.array([start]), np.zeros((1, len(rate))), rate)

    @classmethod
    def sinusoid(
        cls,
        amplitude: ArrayLike,
        frequency: float,
        *,
        phase: float = 0.0,
        start: float = 0.0,
        end: float = math.inf,
        mean: ArrayLike | None = None,
    ) -> History:
        """``mean`` (default 0) plus, from ``start`` to ``end`` s, ``amplitude`` · sin(2π ``frequency`` (t − start) +
        ``phase``); frequency Hz, phase rad."""
        amplitude = np.atleast_1d(np.asarray(amplitude, dtype=float))
        base = cls.constant(np.zeros(len(amplitude)) if mean is None else mean)
        return replace(base, wave=Wave(amplitude, frequency, phase, start, end))

    @classmethod
    def table(cls, times: ArrayLike, values: ArrayLike) -> History:
        """Piecewise linear through ``values`` (n, k) or (n,) at ``times`` (n,) s."""
        values = np.asarray(values, dtype=float)
        return cls(np.asarray(times, dtype=float), values[:, None] if values.ndim == 1 else values)

    @classmethod
    def from_file(cls, path: str | Path, columns: int | None = None, scale: ArrayLike = 1.0) -> History:
        """The record in the text file ``path`` (`read_record`), multiplied by ``scale``.

        ``columns``: required number of values per line. A ``scale`` (k,) turns a one-column record into a vector.
        """
        times, values = read_record(path)
        if columns is not None and values.shape[1] != columns:
            raise ValueError(f"{path}: {values.shape[1]} column(s) of values after the time, expected {columns}")
        return cls(times, values * np.asarray(scale, dtype=float))

    def at(self, time: float) -> np.ndarray:
        """(k,) value at ``time`` s."""
        if len(self.times) == 1:
            value = np.array(self.values[0], dtype=float)
        else:
            value = np.array([np.interp(time, self.times, column) for column in self.values.T])
        if self.rate is not None and time > self.times[-1]:
            value = value + self.rate * (time - self.times[-1])
        if self.wave is not None:
            value = value + self.wave.at(time)
        return value

    def is_steady(self, begin: float, end: float) -> bool:
        """Whether the value is the same all the time from ``begin`` to ``end`` s."""
        if self.wave is not None:
            apart = begin >= self.wave.end or end <= self.wave.start
            return apart and replace(self, wave=None).is_steady(begin, end)
        if self.rate is not None and np.any(self.rate) and end > self.times[-1]:
            return False
        between = self.times[(self.times > begin) & (self.times < end)]
        return all(np.array_equal(self.at(begin), self.at(time)) for time in (*between, end))

    def scaled(self, factor: ArrayLike) -> History:
        """This history times ``factor``: a number, or one per component (k,)."""
        wave = self.wave
        return History(
            self.times,
            np.asarray(self.values, dtype=float) * factor,
            None if self.rate is None else np.asarray(self.rate, dtype=float) * factor,
            None if wave is None else replace(wave, amplitude=wave.amplitude * factor),
        )

    def integral(self, time: float) -> np.ndarray:
        """(k,) exact integral from 0 to ``time`` s: of an acceleration, the velocity from rest."""
        return self._integrals(time)[0] - self._at_zero[0]

    def double_integral(self, time: float) -> np.ndarray:
        """(k,) exact double integral from 0 to ``time`` s: of an acceleration, the displacement from rest."""
        return self._integrals(time)[1] - self._at_zero[1] - self._at_zero[0] * time

    @cached_property
    def _at_zero(self) -> tuple[np.ndarray, np.ndarray]:
        return self._integrals(0.0)

    @cached_property
    def _sums(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, k) each: first and second integral from the first time to every time."""
        dt = np.diff(self.times)[:, None]
        v0, v1 = self.values[:-1], self.values[1:]
        zero = np.zeros((1, self.values.shape[1]))
        once = np.concatenate([zero, np.cumsum(0.5 * dt * (v0 + v1), axis=0)])
        twice = np.concatenate([zero, np.cumsum(once[:-1] * dt + dt**2 * (2 * v0 + v1) / 6, axis=0)])
        return once, twice

    def _integrals(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """First and second integral from the first time to ``time``."""
        once, twice = self._sums
        n = int(np.searchsorted(self.times, time, side="right")) - 1
        start = max(n, 0)
        x = time - self.times[start]
        slope = np.zeros(self.values.shape[1])
        if n == len(self.times) - 1:
            slope = slope if self.rate is None else np.asarray(self.rate, dtype=float)
        elif n >= 0:
            slope = (self.values[n + 1] - self.values[n]) / (self.times[n + 1] - self.times[n])
        v = self.values[start]
        first = once[start] + v * x + slope * x**2 / 2
        second = twice[start] + once[start] * x + v * x**2 / 2 + slope * x**3 / 6
        if self.wave is not None:
            a, b = self.wave.integrals(time)
            first, second = first + a, second + b
        return first, second


def refuse_no_history(what: str, history: object) -> None:
    """Raise TypeError that begins with ``what`` unless ``history`` is a `History`."""
    if not isinstance(history, History):
        raise TypeError(
            f"{what} must be a History (History.constant(…) for a constant), got a {type(history).__name__}"
        )


def baseline_corrected(acceleration: History, degree: int = 1) -> History:
    """Baseline correction: the record minus a polynomial of ``degree`` in time, so that the base does not drift.

    The polynomial is the one whose velocity fits the record's velocity best (least squares): degree 0 removes a
    constant acceleration, 1 a linear one.

    Raises ValueError for fewer than ``degree`` + 2 times, and for a history that has a ``rate`` or a ``wave``.
    """
    times = np.asarray(acceleration.times, dtype=float)
    if acceleration.rate is not None or acceleration.wave is not None:
        raise ValueError("a baseline can be subtracted from a record, not from a ramp or a sinusoid")
    if len(times) < degree + 2:
        raise ValueError(
            f"a baseline of degree {degree} needs at least {degree + 2} times, the record has {len(times)}"
        )
    start, span = times[0], times[-1] - times[0]
    s = (times - start) / span
    velocity, _ = acceleration._sums
    # Velocity of s^k is span s^(k+1)/(k+1).
    basis = np.stack([span * s ** (k + 1) / (k + 1) for k in range(degree + 1)], axis=1)
    coefficients = np.linalg.lstsq(basis, velocity, rcond=None)[0]
    return History(times, acceleration.values - np.stack([s**k for k in range(degree + 1)], axis=1) @ coefficients)


def read_record(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read a record: (times (n,) s, values (n, k)) in SI units from a text file.

    A line holds the time and one or more values, separated by commas, semicolons, tabs or blanks. Empty lines, and text
    after ``#``, are skipped. The first line may be a header with a unit per column: ``time [s], acceleration [g]``;
    without it, units are SI.

    Raises ValueError that names file and line for an unknown unit, a wrong number of columns, text that is no number,
    and times that do not ascend; FileNotFoundError for a missing file.
    """
    path = Path(path)
    rows: list[list[float]] = []
    lines: list[int] = []
    factors: list[float] | None = None
    for number, raw in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), start=1):
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        if factors is None and not rows and re.match(r"[A-Za-z(\[]", line) and not _is_number(line.split()[0]):
            factors = _header(path, number, line)
            continue
        cells = [cell for cell in re.split(r"[,;\s]+", line) if cell]
        wanted = len(rows[0]) if rows else len(factors) if factors else max(len(cells), 2)
        if len(cells) != wanted:
            raise ValueError(
                f"{path}:{number}: {len(cells)} column(s), expected {wanted}: a time and {wanted - 1} value(s)"
            )
        row = []
        for cell in cells:
            if not _is_number(cell):
                raise ValueError(f"{path}:{number}: {cell!r} is not a finite number")
            row.append(float(cell))
        if rows and row[0] <= rows[-1][0]:
            raise ValueError(f"{path}:{number}: time {row[0]:g} is not later than {rows[-1][0]:g} in line {lines[-1]}")
        rows.append(row)
        lines.append(number)
    if not rows:
        raise ValueError(f"{path}: no line has numbers: a time and its values")
    table = np.array(rows) * (1.0 if factors is None else np.array(factors))
    return table[:, 0], table[:, 1:]


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _header(path: Path, number: int, line: str) -> list[float]:
    """Factors to SI units, one per column, from a header such as ``time (s); acceleration (cm/s²)``."""
    columns = (
        re.split(r"[,;\t]+", line) if re.search(r"[,;\t]", line) else re.findall(r"\S+(?:\s*[\[(][^\])]*[\])])?", line)
    )
    factors = []
    for k, column in enumerate(c.strip() for c in columns):
        found = re.search(r"[\[(]([^\])]*)[\])]", column)
        written = found.group(1) if found else ""
        unit = written.strip().lower().replace("²", "2").replace("^", "").replace("**", "")
        known = _TIMES if k == 0 else tuple(UNITS)
        if unit not in known:
            raise ValueError(
                f"{path}:{number}: column {k + 1} is in {written!r}, which is not known; "
                f"{'times are' if k == 0 else 'units are'} {', '.join(u for u in known if u)}"
            )
        factors.append(UNITS[unit])
    if len(factors) < 2:
        raise ValueError(f"{path}:{number}: {len(factors)} column(s) in the header, expected a time and its values")
    return factors
