"""The index of equations: every row names a function that is there, whose docstring or module has the words that mark
the equation."""

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def index():
    found = importlib.util.spec_from_file_location("equation_index", ROOT / "docs" / "generate" / "equations.py")
    module = importlib.util.module_from_spec(found)
    sys.modules[found.name] = module
    found.loader.exec_module(module)
    return module


INDEX = index()
ROWS = [row for chapter in INDEX.rows().values() for row in chapter]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.at.removeprefix("geomech."))
def test_a_row_names_a_function_that_says_the_equation(row):
    said = " ".join(INDEX.docstring(row).split())
    assert row.mark in said, f"{row.at}: its docstring does not mention {row.mark!r}"
    file, _, line = INDEX.place(row).rpartition(":")
    name = row.at.partition(":")[2].rpartition(".")[2]
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    # Decorators stand before the definition.
    assert any(f"def {name}(" in text or f"class {name}" in text for text in lines[int(line) - 1 : int(line) + 4])


def test_all_equations_of_the_paper_are_found():
    """Equations 1 to 16 of Khanizadeh Bahabadi et al. (2023), each named by a row or its text, but 4, 5 (in 2-4 and the
    signs of `geomech.conventions`) and 10 to 13, which rows give as ranges."""
    text = " ".join(row.what + " " + row.source for row in ROWS)
    for said in ("eq. 1)", "eqs. 2–4", "eqs. 2, 3, 8, 9", "eqs. 6, 7, 14, 15", "eqs. 10–13", "eq. 16"):
        assert said in text
