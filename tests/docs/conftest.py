"""The modules of ``docs/generate``, which belong to no package that is installed."""

import sys
from pathlib import Path

import pytest


@pytest.fixture
def docs(monkeypatch) -> Path:
    """The manual's folder, importable while a test lasts."""
    folder = Path(__file__).parents[2] / "docs"
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in [name for name in sys.modules if name.split(".")[0] == "generate"]:
        del sys.modules[name]
