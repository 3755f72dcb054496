"""What is skipped changes no result: the benchmark of skips holds every run against the one that skips nothing."""

from pathlib import Path

import pytest

from geomech.bench import skips


@pytest.mark.slow
def test_results_with_and_without_every_skip_are_the_same(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    found = skips.measure(quick=True)
    assert len(found.figures) == 12
