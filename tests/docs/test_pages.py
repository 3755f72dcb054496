"""What the manual and the README say of files, and how long the README is."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from geomech.scene import load_scene

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
#: Written by the build, or by others beside the manual.
MADE = ("generated/", "gallery/")
PAGES = sorted(
    path
    for path in DOCS.rglob("*")
    if path.suffix in (".md", ".py") and not str(path.relative_to(DOCS)).startswith(MADE)
)
README = ROOT / "README.md"


@pytest.mark.parametrize("page", [README, *PAGES], ids=lambda page: str(page.relative_to(ROOT)))
def test_paths_of_the_project_exist(page):
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"(?<![\w/.-])((?:tests|geomech|geometry|pipelines)/(?!NAME)[\w./-]*\w)(?![\w*…])", text)
    assert [name for name in named if not (ROOT / name).exists()] == []


@pytest.mark.parametrize(
    "page", [README, *(page for page in PAGES if page.suffix == ".md")], ids=lambda page: page.name
)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text)
    absent = [link for link in links if not (page.parent / link).exists() and not any(part in link for part in MADE)]
    # Beside the manual there are files that come with a release.
    assert set(absent) <= {"CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff"}


def test_the_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150


def test_the_scene_of_the_readme_is_that_of_the_manual_and_loads(tmp_path):
    text = re.search(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL).group(1)
    assert text == (DOCS / "start" / "my_slope.toml").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 20
    scene = load_scene(DOCS / "start" / "my_slope.toml")
    assert scene.problem().blocks.n_blocks == 76


@pytest.mark.slow
def test_the_factor_of_the_readme():
    """Limit equilibrium of slabs on their beds; the bracket is a fifth of a percent wide."""
    import geomech

    found = geomech.factor_of_safety(DOCS / "start" / "my_slope.toml")
    exact = np.tan(np.radians(20)) / np.tan(np.radians(25))
    assert found.lower <= exact * (1 + 1e-3) and exact * (1 - 1e-3) <= found.upper
    assert f"{exact:.4f}" in README.read_text(encoding="utf-8")


def test_pictures_are_small():
    pictures = [path for path in DOCS.rglob("*") if path.suffix in (".png", ".gif", ".svg", ".jpg")]
    own = [path for path in pictures if not str(path.relative_to(DOCS)).startswith(MADE)]
    assert sum(path.stat().st_size for path in own) < 5e6


def test_scenes_in_pages_are_toml():
    """Blocks of TOML parse, each by itself."""
    for page in PAGES:
        for block in re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            tomllib.loads(block)


def test_messages_are_those_of_the_program():
    """What stands between the dots of a message is text of the sources."""
    source = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "geomech").rglob("*.py"))
    # Strings that are written over several lines are one.
    source = re.sub(r'"\s*\n\s*f?"', "", source)
    terms = re.findall(r"^(`.+)\n:   ", (DOCS / "reference" / "messages.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(terms) > 20
    fragments = [part.strip() for term in terms for text in re.findall(r"`([^`]+)`", term) for part in text.split("…")]
    assert [part for part in fragments if part and part not in source] == []
