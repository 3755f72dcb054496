"""The figures of benchmarks: errors that got worse than the stored ones are a failure, times are not looked at.

`geomech bench accuracy boundary coupling dda ddm schemes stability steps --quick --out
tests/validation/bench_baseline.json` renews what is stored: only with a reason, and with the errors' change in view.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from geomech.bench.accuracy import (
    block_schemes,
    boundary_stress,
    load_steps,
    pass_tolerance,
    published_values,
    work_precision,
)
from geomech.bench.cost import block_cost
from geomech.bench.figures import ERROR, EXACT, TIME, Measured, changes, compared, less_accurate, read, write
from geomech.bench.robustness import stability

BASELINE = Path(__file__).parent / "bench_baseline.json"
#: The cheap ones among the maps of stability.
MAPS = ("contrast in a column", "slivers in a column", "grid of squares", "head-on impact")
#: What is found may be so many times better than what is stored; more, and the stored figure would no longer see it
#: worsen threefold. Only far above round-off, which differs among machines.
STALE, FAR = 2.5, 100 * EXACT


def errors_of(measured):
    return lambda: Measured.of("", errors=measured())


@pytest.mark.parametrize(
    ("topic", "measured"),
    [
        ("accuracy", published_values.table),
        ("boundary", errors_of(boundary_stress.quick_errors)),
        ("coupling", errors_of(pass_tolerance.errors)),
        ("dda", errors_of(block_cost.errors)),
        ("ddm", errors_of(work_precision.errors)),
        ("schemes", errors_of(block_schemes.errors)),
        pytest.param("stability", errors_of(lambda: stability.quick_shares(MAPS)), marks=pytest.mark.slow),
        pytest.param("steps", lambda: load_steps.measure(quick=True), marks=pytest.mark.slow),
        pytest.param("stability", lambda: stability.measure(quick=True), marks=pytest.mark.slow),
    ],
)
def test_nothing_is_less_accurate_than_it_was(topic, measured, monkeypatch):
    # Some rows need a pipeline below the working folder.
    monkeypatch.chdir(Path(__file__).parents[2])
    before = read(BASELINE)
    found = measured()
    named = {figure.name for figure in found.figures if figure.kind == ERROR}
    assert named and named <= set(before["topics"][topic][ERROR]), "figures that nothing is stored of: renew them"
    rows = [row for row in changes(before, {topic: found}, before["yardstick_s"]) if row.kind == ERROR]
    assert len(rows) == len(named)
    assert not less_accurate(rows), compared(rows, before, BASELINE)
    stale = [row.name for row in rows if row.before > FAR and STALE * row.now < row.before]
    assert not stale, f"much better than what is stored, renew it: {stale}"


def test_any_stored_error_that_grows_threefold_is_a_failure():
    """Each of them by itself, but for those below round-off."""
    before = read(BASELINE)
    for topic in ("accuracy", "boundary", "coupling", "dda", "ddm", "schemes", "stability", "steps"):
        stored = before["topics"][topic][ERROR]
        assert any(value > FAR for value in stored.values()), topic
        for worse in (name for name, value in stored.items() if 3.0 * value > EXACT):
            now = Measured.of(
                "", errors={name: value * (3.0 if name == worse else 1.0) for name, value in stored.items()}
            )
            found = less_accurate(changes(before, {topic: now}, before["yardstick_s"]))
            assert [row.name for row in found] == [worse]


def test_comparison_sees_what_got_worse_and_allows_for_the_machine(tmp_path):
    then = Measured.of("", errors={"a": 1e-4, "b": 1e-15, "c": 1e-3}, times={"t": 1.0, "u": 1.0})
    before = read(write(tmp_path / "figures.json", {"topic": then}, quick=True, unit=0.01))
    now = Measured.of("", errors={"a": 1.2e-4, "b": 1e-12, "c": 5e-4}, times={"t": 2.2, "u": 4.0})
    # The machine is half as fast as it was: t takes as long as it did, u twice as long.
    rows = changes(before, {"topic": now, "other": now}, unit=0.02)
    assert [(r.name, r.kind) for r in rows if r.worse] == [("a", ERROR), ("u", TIME)]
    assert [r.name for r in rows if r.better] == ["c"]
    assert [r.name for r in less_accurate(rows)] == ["a"]
    said = compared(rows, before, tmp_path / "figures.json")
    assert "less accurate: 1" in said
    assert "0.0001 → 0.00012 (1.20 times)" in said


def test_a_file_of_something_else_is_refused(tmp_path):
    (tmp_path / "other.json").write_text(json.dumps({"points": []}))
    with pytest.raises(ValueError, match="has no benchmark figures"):
        read(tmp_path / "other.json")
    (tmp_path / "torn.json").write_text('{"topics": ')
    with pytest.raises(ValueError, match="is not valid JSON"):
        read(tmp_path / "torn.json")
