"""What a sweep varies: lists and ranges of values, and random variables with their distributions.

A variable is written as text, the same on the command line and in a scene:

    20:40:5                        from 20 to 40 in steps of 5, both ends included
    log(1e3, 1e6, 4)               4 values, each the same multiple of the one before
    10, 20, 40                     these values
    normal(35, 5)                  mean, standard deviation; normal(35, 5, 15, 60) is cut off at 15 and 60
    lognormal(1e5, 3e4)            mean and standard deviation of the variable itself
    uniform(20, 40)                bounds
    triangular(20, 30, 40)         lowest, most likely, highest
    beta(0, 1, 2, 5)               bounds, then the exponents α and β of x^(α−1) (1−x)^(β−1)
    exponential(0.08, 0, 0.16)     mean before it is cut off, and where it is cut off

Unbounded distributions may have two more numbers, between which they are truncated (and renormalised); inf is allowed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

#: Distribution → its parameters in order; truncatable ones end with "low" and "high".
LAWS = {
    "normal": ("mean", "deviation"),
    "lognormal": ("mean", "deviation"),
    "exponential": ("mean",),
    "uniform": ("low", "high"),
    "triangular": ("low", "mode", "high"),
    "beta": ("low", "high", "alpha", "beta"),
}
#: Those with bounds of their own.
_BOUNDED = ("uniform", "triangular", "beta")
#: Distance, in units of the step, below which a range includes its last value.
_ROUNDOFF = 1e-9
#: Largest number of values in a range.
_MOST = 1_000_000
_CALL = re.compile(r"\s*([a-z_]+)\s*\(([^()]*)\)\s*\Z")


class VariableError(ValueError):
    """An invalid variable: ``message`` and ``way_out``."""

    def __init__(self, message: str, way_out: str) -> None:
        super().__init__(f"{message}: {way_out}")
        self.message, self.way_out = message, way_out


@dataclass(frozen=True)
class Listed:
    """A variable called ``name`` (a key of the scene, or a name for expressions) that takes each of the ``values``."""

    name: str
    values: tuple[Any, ...]

    def __str__(self) -> str:
        shown = ", ".join(map(str, self.values[:6]))
        return shown + (f", … ({len(self.values)} values)" if len(self.values) > 6 else "")


@dataclass(frozen=True)
class Random:
    """A variable called ``name`` with the distribution ``law`` of these ``parameters``, truncated at ``low`` and
    ``high`` (bounded distributions: their own bounds)."""

    name: str
    law: str
    parameters: tuple[float, ...]
    low: float = -math.inf
    high: float = math.inf

    def __str__(self) -> str:
        cut = [] if self.law in _BOUNDED or (math.isinf(self.low) and math.isinf(self.high)) else [self.low, self.high]
        return f"{self.law}({', '.join(f'{x:g}' for x in (*self.parameters, *cut))})"

    def quantile(self, share: np.ndarray) -> np.ndarray:
        """Quantiles of the variable at probabilities ``share`` (n,) in (0, 1)."""
        law = self._law()
        share = np.asarray(share, dtype=float)
        if self._is_cut:
            # Computed from the nearer end, so that far tails are accurate.
            below, above = float(law.cdf(self.low)), float(law.sf(self.high))
            lower = below + share * (1.0 - below - above)
            upper = above + (1.0 - share) * (1.0 - below - above)
            found = np.where(share <= 0.5, law.ppf(lower), law.isf(upper))
            return np.clip(found, self.low, self.high)
        return np.where(share <= 0.5, law.ppf(share), law.isf(1.0 - share))

    def outside(self, low: float, high: float) -> float:
        """The probability of a value below ``low`` or above ``high``."""
        law = self._law()
        if self._is_cut:
            below, above = float(law.cdf(self.low)), float(law.sf(self.high))
            inside = 1.0 - below - above
            under = max(0.0, float(law.cdf(low)) - below) / inside
            over = max(0.0, float(law.sf(high)) - above) / inside
            return min(1.0, under + over)
        return float(law.cdf(low) if math.isfinite(low) else 0.0) + float(law.sf(high) if math.isfinite(high) else 0.0)

    @property
    def _is_cut(self) -> bool:
        return self.law not in _BOUNDED and (math.isfinite(self.low) or math.isfinite(self.high))

    def _law(self) -> Any:
        """The distribution of `scipy.stats` before truncation."""
        from scipy import stats

        p = self.parameters
        if self.law == "normal":
            return stats.norm(p[0], p[1])
        if self.law == "lognormal":
            spread = math.sqrt(math.log1p((p[1] / p[0]) ** 2))
            return stats.lognorm(spread, scale=p[0] * math.exp(-0.5 * spread**2))
        if self.law == "exponential":
            return stats.expon(scale=p[0])
        if self.law == "uniform":
            return stats.uniform(p[0], p[1] - p[0])
        if self.law == "triangular":
            return stats.triang((p[1] - p[0]) / (p[2] - p[0]), p[0], p[2] - p[0])
        return stats.beta(p[2], p[3], p[0], p[1] - p[0])


Variable = Listed | Random


def variable(name: str, written: Any) -> Variable:
    """The variable ``name`` as it is ``written``: a text (see the module), a list of values, one value, or a table with
    `law` and its parameters by name. Raises VariableError."""
    if isinstance(written, dict):
        return _of_table(name, written)
    if isinstance(written, (list, tuple)):
        return _listed(name, list(written))
    if not isinstance(written, str):
        return _listed(name, [written])
    text = written.strip()
    called = _CALL.match(text)
    if called:
        return _called(name, called[1], _numbers(called[2], text), text)
    if "(" in text:
        raise VariableError(
            f"{text} is not a distribution", f"there are {', '.join(('log', *LAWS))}, for example normal(35, 5)"
        )
    if re.fullmatch(r"[^,:]+(:[^,:]+){1,2}", text) and all(_is_number(part) for part in text.split(":")):
        return _listed(name, _range([float(part) for part in text.split(":")], text))
    return _listed(name, [_value(part) for part in text.strip("[]").split(",") if part.strip()])


def _listed(name: str, values: Sequence[Any]) -> Listed:
    if not values:
        raise VariableError(
            "no values", "write a list, such as 20, 30, 40, a range, such as 20:40:5, or a distribution"
        )
    if len(set(map(repr, values))) < len(values):
        raise VariableError("a value is given twice", "write each value once: all are run")
    if any(isinstance(value, float) and not math.isfinite(value) for value in values):
        raise VariableError("a value is not finite", "write finite numbers")
    return Listed(name, tuple(values))


def _called(name: str, law: str, numbers: list[float], text: str) -> Variable:
    if law == "log":
        return _listed(name, _log_range(numbers, text))
    if law not in LAWS:
        known = ", ".join(("log", *LAWS))
        raise VariableError(f"there is no distribution {law!r}", f"there are {known}")
    names = LAWS[law]
    cut = () if law in _BOUNDED else ("low", "high")
    if len(numbers) not in {len(names), len(names) + len(cut)}:
        shown = f"{law}({', '.join(names)}" + (f"[, {', '.join(cut)}]" if cut else "") + ")"
        raise VariableError(f"{text} has {len(numbers)} numbers", f"write {shown}")
    return _random(name, law, numbers)


def _of_table(name: str, table: dict[str, Any]) -> Random:
    law = table.get("law")
    if law not in LAWS:
        raise VariableError(f"there is no distribution {law!r}", f"`law` is one of {', '.join(LAWS)}")
    names = LAWS[law] if law in _BOUNDED else (*LAWS[law], "low", "high")
    unknown = [key for key in table if key not in (*names, "law")]
    missing = [key for key in LAWS[law] if key not in table]
    if unknown or missing:
        raise VariableError(
            f"a {law} distribution has " + (f"no {unknown[0]!r}" if unknown else f"to have {missing[0]!r}"),
            f"its keys are {', '.join(names)}",
        )
    defaults = {"low": -math.inf, "high": math.inf}
    numbers: list[Any] = [table.get(key, defaults.get(key)) for key in names]
    if not all(isinstance(number, (int, float)) and not isinstance(number, bool) for number in numbers):
        raise VariableError(f"the parameters of {law} must be numbers", f"its keys are {', '.join(names)}")
    return _random(name, law, [float(number) for number in numbers])


def _random(name: str, law: str, numbers: list[float]) -> Random:
    p = numbers[: len(LAWS[law])]
    if not all(map(math.isfinite, p)):
        raise VariableError("a parameter is not finite", f"write {law}({', '.join(LAWS[law])})")
    low, high = numbers[len(p) :] or (-math.inf, math.inf)
    if law == "uniform":
        low, high = p
    elif law == "triangular":
        low, high = p[0], p[2]
        if not p[0] <= p[1] <= p[2]:
            raise VariableError(
                f"the most likely value {p[1]:g} is not between {low:g} and {high:g}", "put them in ascending order"
            )
    elif law == "beta":
        low, high = p[:2]
        if p[2] <= 0 or p[3] <= 0:
            raise VariableError("α and β must be > 0", "write beta(low, high, alpha, beta)")
    elif law == "normal" and p[1] <= 0:
        raise VariableError(f"the standard deviation {p[1]:g} is not > 0", "write one > 0, or a single value")
    elif law in ("lognormal", "exponential") and min(p) <= 0:
        raise VariableError(f"{law} needs numbers > 0", f"write {law}({', '.join(LAWS[law])}) with numbers > 0")
    if not low < high:
        raise VariableError(f"no value lies between {low:g} and {high:g}", "put the lower bound first")
    made = Random(name, law, tuple(p), low, high)
    if law not in _BOUNDED and Random(name, law, tuple(p)).outside(low, high) > 1.0 - 1e-12:
        raise VariableError(f"its probability between {low:g} and {high:g} is zero", "truncate it farther out")
    return made


def _range(numbers: list[float], text: str) -> list[float | int]:
    first, last, *rest = numbers
    step = rest[0] if rest else 1.0
    if step == 0 or (last - first) / step < 0 or not all(map(math.isfinite, numbers)):
        raise VariableError(f"the range {text} is empty", "write first:last:step, such as 20:40:5 or 40:20:-5")
    count = math.floor((last - first) / step + _ROUNDOFF) + 1
    if count > _MOST:
        raise VariableError(f"the range {text} has {count} values", f"give at most {_MOST}")
    whole = all(number == int(number) for number in (first, step)) and "." not in text and "e" not in text.lower()
    return [int(first + k * step) if whole else _rounded(first + k * step, step) for k in range(count)]


def _rounded(value: float, step: float) -> float:
    """``value`` without the round-off of adding ``step``."""
    digits = 12 - math.floor(math.log10(abs(step)))
    return round(value, max(0, digits))


def _log_range(numbers: list[float], text: str) -> list[float]:
    if len(numbers) != 3 or min(numbers[:2]) <= 0 or numbers[2] < 2 or numbers[2] != int(numbers[2]):
        raise VariableError(
            f"{text} is not a logarithmic range", "write log(first, last, number), such as log(1e3, 1e6, 4)"
        )
    first, last, count = numbers[0], numbers[1], int(numbers[2])
    if count > _MOST or first == last:
        raise VariableError(
            f"{text} is not a logarithmic range", f"first and last must differ, with at most {_MOST} values"
        )
    return [float(f"{value:.12g}") for value in np.geomspace(first, last, count)]


def _numbers(text: str, whole: str) -> list[float]:
    parts = [part.strip() for part in text.split(",")]
    if not all(map(_is_number, parts)):
        raise VariableError(f"{whole} has entries that are not numbers", "write numbers separated by commas")
    return [float(part) for part in parts]


def _is_number(text: str) -> bool:
    try:
        return not math.isnan(float(text))
    except ValueError:
        return False


def _value(text: str) -> Any:
    """A whole number, a number, true, false, or a word."""
    text = text.strip()
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text.strip("\"'"))
