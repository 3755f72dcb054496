"""How `pip install .` builds geomech: as setuptools does, without the ``build`` folder that it leaves behind.

A later installation would take modules from there that the sources no longer have.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 (all hooks but the one below)

#: Below the project's folder, in which the hooks are called.
LEFT = Path("build")


@contextmanager
def _without_leftovers() -> Iterator[None]:
    shutil.rmtree(LEFT, ignore_errors=True)
    try:
        yield
    finally:
        shutil.rmtree(LEFT, ignore_errors=True)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """The hook of PEP 517."""
    with _without_leftovers():
        return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)
