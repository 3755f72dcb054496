"""The study of the toppling slope, run as the command line runs it, against the published example."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from geomech.cli import DONE, main

FOLDER = Path(__file__).parents[2] / "pipelines" / "toppling_slope"
sys.path.insert(0, str(FOLDER))
import compare_toppling_slope as study


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the study hands to its report, and its folder."""
    out, seen = tmp_path_factory.mktemp("toppling"), {}
    written = study.report

    def keep(limit, table, friction, modes, safety):
        seen.update(limit=limit, table=table, modes=modes, safety=safety)
        return written(limit, table, friction, modes, safety)

    study.report = keep
    try:
        assert main(["run", str(FOLDER), "--quiet", "--out", str(out)]) == DONE
    finally:
        study.report = written
    return {**seen, "out": out}


def test_its_check_holds_and_sees_what_is_off(seen):
    """That of the study itself: least friction, factor of safety, forces and what each block does, as published."""
    limit, table, modes, safety = (seen[name] for name in ("limit", "table", "modes", "safety"))
    study.check(limit, table, modes, safety)
    with pytest.raises(AssertionError, match="least friction"):
        study.check(limit + 0.005, table, modes, safety)
    with pytest.raises(AssertionError, match="factor of safety"):
        study.check(limit, table, modes, (safety[0], 1.02 * safety[1]))
    with pytest.raises(AssertionError, match="force"):
        study.check(limit, (table[0] + 50.0, *table[1:]), modes, safety)
    with pytest.raises(AssertionError, match="every block"):
        study.check(limit, table, modes[::-1], safety)


def test_it_writes_its_files(seen):
    assert "least friction" in (seen["out"] / "comparison.txt").read_text(encoding="utf-8")
    assert (seen["out"] / "toppling_slope.png").stat().st_size > 20_000
