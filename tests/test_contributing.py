"""CONTRIBUTING.md names files, folders and functions that exist, and its walks name what stands in them."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GUIDE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
#: What stands in single backticks; fenced code is no prose.
PROSE = re.sub(r"^ *```.*?^ *```", "", GUIDE, flags=re.MULTILINE | re.DOTALL)
QUOTED = re.findall(r"`([^`\n]+)`", PROSE)
FOLDERS = ("geomech/", "tests/", "pipelines/", "geometry/", ".ci/")
PATHS = sorted({text for text in QUOTED if text.startswith(FOLDERS) and " " not in text})
#: A step of a walk: its function, and the names between the dash and the remark after a colon.
STEPS = re.findall(r"^\d+\. `([^`\n]+\.py:[^`\n]+)` — (.+(?:\n   .+)*)$", PROSE, flags=re.MULTILINE)


@cache
def syntax(file: str) -> ast.Module:
    return ast.parse((ROOT / file).read_text(encoding="utf-8"))


def definition(place: str) -> ast.AST | None:
    """What ``place``, "file:name" or "file:Class.name", defines: a function, a class or a name; None without any."""
    file, _, dotted = place.partition(":")
    node = syntax(file)
    for part in dotted.split("."):
        node = next((each for each in node.body if part in names_of(each)), None)
        if node is None:
            return None
    return node


def names_of(node: ast.AST) -> list[str]:
    """The names that a statement defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [target.id for target in targets if isinstance(target, ast.Name)]


def words_in(node: ast.AST) -> set[str]:
    """All names, attributes, arguments, keywords and texts below ``node``; docstrings do not count."""
    found: set[str] = set()
    for each in ast.walk(node):
        for field in ("id", "attr", "arg", "name"):
            found.add(getattr(each, field, None))
        if isinstance(each, ast.Constant) and isinstance(each.value, str) and " " not in each.value:
            found.add(each.value)
    return found


@pytest.mark.parametrize("path", PATHS)
def test_files_and_functions_exist(path):
    file = path.partition(":")[0]
    assert (ROOT / file).exists(), f"CONTRIBUTING.md: there is no {file}"
    assert ":" not in path or definition(path) is not None, (
        f"CONTRIBUTING.md: {file} defines no {path.partition(':')[2]}"
    )


@pytest.mark.parametrize(("place", "rest"), STEPS, ids=[place for place, _ in STEPS])
def test_steps_of_a_walk_name_what_stands_in_their_function(place, rest):
    wanted = re.findall(r"`(\w+)`", re.split(r": | \(", rest)[0])
    missing = set(wanted) - words_in(definition(place))
    assert wanted and not missing, f"CONTRIBUTING.md: nothing called {sorted(missing)} in {place}"


def test_the_reader_of_the_guide_sees_what_is_wrong():
    """The checks above are only as good as their reading."""
    assert len(PATHS) > 100 and len(STEPS) > 50
    assert not [line for line in PROSE.splitlines() if line.count("`") % 2], "a name in backticks goes over two lines"
    assert definition("geomech/conventions.py:normal_of") is not None
    assert definition("geomech/conventions.py:VTK_STRESS") is not None
    assert definition("geomech/conventions.py:no_such_name") is None
    assert definition("geomech/model/blocks/block_arrays.py:Blocks.n_blocks") is not None
    assert definition("geomech/model/blocks/block_arrays.py:Blocks.normal_of") is None
    assert "stack" in words_in(definition("geomech/conventions.py:traction"))
    assert "tension" not in words_in(definition("geomech/conventions.py:traction"))
