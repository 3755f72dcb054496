"""How `pip install .` builds geomech: as setuptools does, with the examples, and without the ``build`` folder that it
leaves behind.

A later installation would take modules from there that the sources no longer have.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 (all hooks but those below)

#: Below the project's folder, in which the hooks are called.
LEFT = Path("build")


#: What the examples of a wheel are made of, and where they stand in it (`geomech.examples`).
EXAMPLES = {"pipelines": "pipelines", "geometry": "geometry", "outputs/gallery": "gallery"}
IN_THE_WHEEL = Path("geomech/example_files")
#: What an sdist holds besides the package.
SDIST = ("tests", "pipelines", "geometry", "docs", "outputs/gallery")


@contextmanager
def _with_examples() -> Iterator[None]:
    """The examples' folders copied to where the package's data is taken from, while it is."""
    shutil.rmtree(IN_THE_WHEEL, ignore_errors=True)
    try:
        for name, inside in EXAMPLES.items():
            if Path(name).is_dir():
                left_out = shutil.ignore_patterns("__pycache__", "*.pyc", "bench_*", "stability*")
                shutil.copytree(name, IN_THE_WHEEL / inside, ignore=left_out)
        yield
    finally:
        shutil.rmtree(IN_THE_WHEEL, ignore_errors=True)


@contextmanager
def _with_manifest() -> Iterator[None]:
    """A MANIFEST.in, which setuptools reads and the sources need not hold."""
    manifest = Path("MANIFEST.in")
    lines = [f"graft {folder}" for folder in SDIST] + ["global-exclude __pycache__ *.py[cod]", "include *.md *.cff"]
    manifest.write_text("\n".join([*lines, ""]), encoding="utf-8")
    try:
        yield
    finally:
        manifest.unlink(missing_ok=True)


@contextmanager
def _without_leftovers() -> Iterator[None]:
    shutil.rmtree(LEFT, ignore_errors=True)
    try:
        yield
    finally:
        shutil.rmtree(LEFT, ignore_errors=True)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """The hook of PEP 517."""
    with _without_leftovers(), _with_examples():
        return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    """The hook of PEP 517: with tests, studies, drawings and the manual."""
    with _with_manifest():
        return build_meta.build_sdist(sdist_directory, config_settings)
