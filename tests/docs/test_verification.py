"""The verification pages say what tests and benchmarks stored, and stored figures belong to tests that are there."""

import ast
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STORED = json.loads((ROOT / "docs" / "verification" / "figures.json").read_text(encoding="utf-8"))


@pytest.fixture
def verification(docs):
    from generate import verification

    return verification


@pytest.mark.parametrize("path", STORED)
def test_stored_figures_belong_to_tests_that_state_them(path):
    """A test that was renamed, or states figures no more, leaves nothing behind; one that states figures has stored
    them."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    stating = {
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and "verified" in [argument.arg for argument in node.args.args]
    }
    assert {name.partition("[")[0] for name in STORED[path]} == stating


def test_every_test_that_states_figures_is_on_a_page(verification):
    shown = {path for name in verification.CHAPTERS for path in verification.measured(name)}
    assert shown == set(STORED)
    stating = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "tests").rglob("test_*.py")
        if re.search(r"^def test_\w+\([^)]*\bverified\b", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert stating == set(STORED), "figures are stored by `pytest --record-figures FILE`"


@pytest.mark.parametrize("name", ["blocks", "cracks", "coupled"])
def test_a_page_shows_every_case_and_command(verification, name):
    page = verification.chapter(name)
    for path, tests in verification.measured(name).items():
        assert path in page
        for case, row in verification.merged(tests).items():
            assert case in page
            if "over" in row:
                assert f"| {row['over']} | {' | '.join(f'{x:g}' for x in row['at'])} |" in page
            elif "unit" not in row:
                assert f"| {verification._short(row['errors'][0])} | {row['against']} |" in page


def test_variants_of_a_case_are_shown_by_the_worst(verification):
    row = {"against": "closed form", "errors": [1e-6], "found": 1.0, "exact": 1.0}
    worse = row | {"errors": [3e-6]}
    tests = {f"test[{k}]": {"slow": False, "cases": {"a": r}} for k, r in enumerate((row, worse, row))}
    assert verification.merged(tests) == {"a": {"against": "closed form", "errors": [3e-6], "variants": 3}}


def test_orders_are_those_of_the_errors(verification):
    row = {"against": "", "errors": [4e-2, 1e-2, 2.5e-3], "over": "step, ms", "at": [4, 2, 1]}
    *_, orders = verification._convergence(row)
    assert orders == "| observed order |  | 2.0 | 2.0 |"


def test_the_table_of_the_paper_has_its_numbers(verification):
    cases = STORED["tests/pipelines/test_two_cracks.py"]["test_all_four_as_published"]["cases"]
    table = verification.two_cracks()
    for phi in (0, 30, 60, 90):
        row = next(line for line in table.splitlines() if line.startswith(f"| {phi}° |"))
        assert f"{cases[f'φ = {phi}°: coalescence']['found']:.4g} (" in row
    # Three lines of the published table, as printed.
    assert "| −66.0° | −69.2° |" in table and "| 22.0° | −69.1° |" in table


def test_times_are_the_stored_ones_and_have_their_machine(verification):
    page = verification.times()
    stored = json.loads(verification.TIMES.read_text(encoding="utf-8"))
    assert stored["machine"]["processor"] in page
    for topic, found in stored["topics"].items():
        for name, value in found["time"].items():
            assert f"| {name} | {verification._seconds(value)} |" in page, topic


def test_no_table_of_figures_is_typed_by_hand():
    """Tables of verification are made; what is written by hand are words."""
    for page in (ROOT / "docs" / "verification").glob("*.md"):
        assert not re.search(r"^\|---", page.read_text(encoding="utf-8"), re.MULTILINE), page.name


def test_a_figure_that_has_got_worse_or_is_stale_is_a_failure(agrees):
    assert agrees(1e-4, 1e-4) and agrees(2.9e-4, 1e-4) and agrees(2e-5, 1e-4)
    assert not agrees(4e-4, 1e-4) and not agrees(5e-6, 1e-4)
    # Round-off differs among machines.
    assert agrees(8e-10, 1e-15) and agrees(0.0, 5e-10)


@pytest.fixture
def agrees():
    """`tests/conftest.py` by its path: the name `conftest` may be another's."""
    import importlib.util

    found = importlib.util.spec_from_file_location("figures_conftest", ROOT / "tests" / "conftest.py")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module._agrees
