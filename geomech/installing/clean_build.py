"""Build hooks of `pip install .`: as setuptools, with the examples, and without the ``build`` folder that setuptools
leaves behind.

From that folder a later installation would take modules that no longer exist in the sources.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 (all hooks but those below)

#: Relative to the project's folder, in which the hooks are called.
LEFT = Path("build")


#: Folders of the examples, and their location in a wheel (`geomech.examples`).
EXAMPLES = {"pipelines": "pipelines", "geometry": "geometry", "outputs/gallery": "gallery"}
IN_THE_WHEEL = Path("geomech/example_files")
#: Content of an sdist in addition to the package.
SDIST = ("tests", "pipelines", "geometry", "docs", "outputs/gallery")


@contextmanager
def _with_examples() -> Iterator[None]:
    """Context in which the examples' folders are copied to where the package's data are read from."""
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
    """Context with a MANIFEST.in, which setuptools reads; the sources need not contain it."""
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
    """PEP 517 hook."""
    with _without_leftovers(), _with_examples():
        return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    """PEP 517 hook; the archive includes tests, studies, drawings and the manual."""
    with _with_manifest():
        return build_meta.build_sdist(sdist_directory, config_settings)
