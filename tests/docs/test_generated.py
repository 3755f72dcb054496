"""Pages that are written by the program itself, and the build of the whole manual."""

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_every_key_verb_and_column_is_in_its_page(docs, tmp_path, capsys):
    from generate import pages

    from geomech import cli
    from geomech.output import fields
    from geomech.scene.keys import places_of_keys

    pages.write_all(tmp_path)
    keys = (tmp_path / "scene_keys.md").read_text(encoding="utf-8")
    values = {
        key
        for key, places in places_of_keys().items()
        if f"\n`{key}` = " in keys or f".{key}" in keys or f"[{key}" in keys
    }
    assert values == set(places_of_keys())
    commands = (tmp_path / "command_line.md").read_text(encoding="utf-8")
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    verbs = re.findall(r"^    ([a-z]+) ", capsys.readouterr().out, re.MULTILINE)
    assert {"check", "run", "resume"} < set(verbs)
    for verb in verbs:
        assert f"## geomech {verb}\n" in commands
    assert "--overwrite" in commands and "--along" in commands
    files = (tmp_path / "output_files.md").read_text(encoding="utf-8")
    for column in (*fields.HISTORY, *fields.TIPS, *fields.JOINTS, *(field.name for field in fields.SERIES["tips"])):
        assert f"`{column}`" in files
    # What is the same is not written again: the build would read it again.
    before = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    pages.write_all(tmp_path)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before


def test_figures_of_verification_are_the_stored_ones(docs, tmp_path):
    """Every error of a topic that the page shows stands in it, in the digits it shows."""
    from generate import verification

    written = verification.pages()
    stored = json.loads((ROOT / "tests" / "validation" / "bench_baseline.json").read_text(encoding="utf-8"))["topics"]
    for topic in verification.TOPICS:
        for name, value in stored[topic]["error"].items():
            assert f"| {name} | {verification._short(value)} |" in written["accuracy.md"]
    # Shi's scheme is of first order, the trapezoidal rule of second.
    orders = written["observed_orders.md"]
    for scheme, order in (("Shi's scheme", 0.9), ("Newmark (¼, ½)", 2.0)):
        table = orders.partition(f"**wave along a row, by time step (s), {scheme}, springs**")[2].partition("**")[0]
        assert f"| observed order |  | {order:.1f} |" in table


def test_all_messages_are_those_of_the_sources(docs):
    from generate import messages

    page = messages.page()
    assert "gravity points upwards\\\n  → *y runs up" in page  # a warning of a scene with its way out
    assert "viscous boundaries have no effect in a static run" in page  # of a run
    assert page.count("\n- ") > 150 and "%" + "s" not in page
    for title, *where in (messages.SCENE_ERRORS, messages.SCENE_WARNINGS, messages.RUN_WARNINGS):
        assert title in page and len(set(messages.messages(*where))) > 15


def test_docstrings_become_restructured_text(docs):
    from generate.docstrings import as_rst

    lines = [
        "One block.",
        "",
        "area      m², |A|",
        "          of the polygon",
        "a, b      (n,) sides",
        "",
        "    x = a * b",
        "",
        "Said::",
        "",
        "    code()",
    ]
    assert [line for line in as_rst(lines) if line] == [
        "One block.",
        r"- ``area``: m², \|A\|",
        "  of the polygon",
        "- ``a``, ``b``: (n,) sides",
        ".. code-block:: text",
        "       x = a * b",
        "Said::",
        "       code()",
    ]  # fmt: skip


@pytest.mark.parametrize("page", ["blocks_alone.md", "cracks_alone.md"])
def test_the_first_example_of_a_page_runs(page):
    """The solvers alone, as the how-to shows them."""
    text = (ROOT / "docs" / "howto" / page).read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0 and done.stdout, done.stderr


@pytest.mark.slow
def test_the_manual_builds_without_a_warning(tmp_path):
    """Without running the tutorials, which have tests of their own; a minute."""
    if any(
        importlib.util.find_spec(name) is None for name in ("sphinx", "myst_parser", "sphinx_gallery", "sphinx_design")
    ):
        pytest.skip("the manual's packages are not installed: pip install -e '.[docs]'")
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "-b",
        "html",
        "-D",
        "plot_gallery=False",
        "docs",
        str(tmp_path / "html"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    pages = [path.read_text(encoding="utf-8") for path in (tmp_path / "html").rglob("*.html")]
    # Nothing is fetched: the manual is read from files, without a network.
    assert len(pages) > 40
    assert [found for page in pages for found in re.findall(r'(?:src|href)="https?://[^"]*\.(?:js|css)', page)] == []
    assert (tmp_path / "html" / "_static" / "mathjax").is_dir() and (tmp_path / "html" / "searchindex.js").is_file()
