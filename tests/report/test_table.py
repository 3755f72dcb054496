"""The table of runs side by side: loads in the unit of their size."""

from __future__ import annotations

import pytest

from geomech.report.table import COLUMNS, as_csv, as_text, shown


def row(name: str, initiation: float | None, peak: float | None) -> dict:
    given = {"run": name, "end": "split", "initiation MPa": initiation, "peak MPa": peak, "cycles": 3}
    return dict.fromkeys(COLUMNS) | given


@pytest.mark.parametrize(
    ("loads", "unit", "cells"),
    [
        ([(0.009, 0.0216), (None, 0.0104)], "kPa", ["9.00", "21.60", "10.40"]),
        ([(48.474, 218.84), (45.1, 226.7)], "MPa", ["48.47", "218.84", "226.70"]),
        ([(0.009, 12.0)], "MPa", ["0.01", "12.00"]),
    ],
)
def test_loads_are_told_in_the_unit_of_the_largest(loads, unit, cells):
    rows = [row(f"run_{k}", *load) for k, load in enumerate(loads)]
    headers, *lines = shown(rows)
    assert headers == ["run", "end", f"initiation {unit}", f"peak {unit}", "cycles"]
    assert set(cells) <= {cell for line in lines for cell in line}
    assert f"peak {unit}" in as_text(rows).splitlines()[0]
    # For programs the unit stays what it is.
    assert "peak MPa" in as_csv(rows).splitlines()[0]
