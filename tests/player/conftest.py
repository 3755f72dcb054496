"""The made-up run of `tests/output/synthetic_run.py`, whose every number is known."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parents[1] / "output"), str(Path(__file__).parent)]
import synthetic_run as made

from geomech.output import Histories, Places, Series, Summary


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory) -> Path:
    """Seven cycles: four load steps, three growth passes; the field inside the rock in five of them."""
    folder = tmp_path_factory.mktemp("played") / "one"
    made.write(folder, [Histories(), Series(interior_every=1), Places(), Summary()])
    return folder
