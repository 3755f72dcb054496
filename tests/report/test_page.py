"""Pages: whole HTML that needs nothing beside it, with every number where it belongs."""

from __future__ import annotations

import base64
import json
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "output"))
import synthetic_run as made

from geomech.cli import BAD_INPUT, DONE, main
from geomech.output import Histories, Run, Series, Summary
from geomech.report import write_page
from geomech.report.comparison_page import differences
from geomech.report.page import Page, written

#: A picture of one black pixel.
DOT = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg=="
EMPTY = {"meta", "img", "br", "hr", "input", "link"}


class Read(HTMLParser):
    """Tags that are opened and not closed, pictures, links to elsewhere, tables as rows of cells."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open, self.images, self.elsewhere, self.tables, self.words = [], [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if tag not in EMPTY:
            self.open.append(tag)
        if tag == "img":
            assert given["alt"]
            kind, _, data = given["src"].partition(";base64,")
            self.images.append((kind.removeprefix("data:"), base64.b64decode(data, validate=True)))
        # The player's script stands in the page itself.
        if tag in ("link", "iframe") or (tag == "script" and "src" in given) or given.get("href", "#")[0] != "#":
            self.elsewhere.append((tag, given))
        if tag == "table":
            self.tables.append([])
        if tag == "tr":
            self.tables[-1].append([])
        if tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)
        if {"td", "th"} & set(self.open):
            self.tables[-1][-1][-1] += data

    def table(self, header: str) -> list[list[str]]:
        """The first table with a column of that name."""
        return next(rows for rows in self.tables if header in rows[0])


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for name in ("one", "other"):
        made.write(folder / name, [Histories(), Series(interior_every=0), Summary()])
    (folder / "other" / "run.log").write_text(
        "2026-01-01 00:00:00,1 WARNING geomech.dda: blocks <overlap>\n    & so on\n2026-01-01 00:00:01,1 INFO    "
        "geomech.run: ended\n"
    )
    return folder


def test_a_page_is_whole_and_escapes_what_it_is_reported():
    page = Page("A < B & C", "lead <script>alert(1)</script>")
    page.section("One")
    page.table(["name", "value"], [["<b>", 1.5], ["x", None], ["y", 12345], ["z", -2.5e-7]], "of <all>")
    page.bars(["phase", "s"], {"<dda>": 2.0, "ddm": 1.0})
    page.facts({"nothing": None, "end": "<collapse>"})
    page.folded("scene", "a = '<&>'")
    text = str(page)
    assert "<script" not in text and "<collapse>" not in text
    read = Read(text)
    assert read.elsewhere == []
    assert read.table("value")[1:] == [["<b>", "1.5"], ["x", "–"], ["y", "12\u202f345"], ["z", "−2.5·10⁻⁷"]]
    assert "nothing" not in "".join(read.words)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (float("nan"), "–"), (True, "yes"), (3, "3"), (-0.5, "−0.5"), (1e9, "10⁹"), ("as it is", "as it is")],
)
def test_numbers_as_they_are_written(value, text):
    assert written(value).replace("1·10⁹", "10⁹") == text


def test_page_of_a_run(runs, capsys):
    assert main(["report", str(runs / "other")]) == DONE
    told = capsys.readouterr()
    page = runs / "other" / "report.html"
    assert str(page) in told.err
    read = Read(page.read_text(encoding="utf-8"))
    assert read.elsewhere == []
    run = Run(runs / "other")
    words = "".join(read.words)
    assert run.title in words and "The run, cycle by cycle" in words
    # Escaped in the file, itself again when read.
    assert "blocks <overlap> & so on" in words
    events = read.table("event")
    assert [row[0] for row in events[1:]] == [str(kind) for kind in run.events["kind"]]
    assert float(events[1][3]) == pytest.approx(run.events["load"][0] / 1e6, rel=1e-3)
    tips = read.table("K_eq, MPa√m")
    assert float(tips[1][4].replace("−", "-")) == pytest.approx(run.tips["K_I"][0] / 1e6, rel=1e-3)
    assert {kind for kind, _ in read.images} <= {"image/png", "image/svg+xml"}
    assert any(data[:5] == b"<?xml" for _, data in read.images)


def test_a_studys_own_page_is_not_written_over(runs):
    study = runs / "report.html"
    study.write_text("tables of the study")
    made = write_page(runs, [Run(runs / "one"), Run(runs / "other")], play=False)
    assert made == runs / "runs.html" and "<script" not in made.read_text(encoding="utf-8")
    assert study.read_text() == "tables of the study"
    study.unlink()
    made.unlink()


def test_page_of_runs_side_by_side(runs, capsys):
    assert main(["report", str(runs), "--out", str(runs / "pages" / "all.html")]) == DONE
    capsys.readouterr()
    read = Read((runs / "pages" / "all.html").read_text(encoding="utf-8"))
    rows = read.table("initiation MPa")
    assert [row[0] for row in rows] == ["run", "one", "other"]
    assert rows[1][2] == "0.60"  # initiation at 3 steps of 0.2 MPa


def test_what_differs_between_scenes(runs):
    one, other = Run(runs / "one"), Run(runs / "other")
    vars(one)["scene"] = {"title": "a", "ddm": {"order": 4}, "loads": {"tractions": [{"rate": [0.0, 1.0]}]}}
    vars(other)["scene"] = {
        "title": "b",
        "ddm": {"order": 2, "nodes": "equal"},
        "loads": {"tractions": [{"rate": [0.0, 1.0]}]},
    }
    assert differences([one, other]) == {"ddm.order": [4, 2], "ddm.nodes": [None, "equal"]}


def test_page_of_a_benchmark(tmp_path, capsys):
    folder = tmp_path / "bench_made"
    folder.mkdir()
    points = [{"problem": "crack", "error": 1e-4, "seconds": 0.25}, {"problem": "star", "error": 2e-6, "seconds": 0.5}]
    (folder / "points.json").write_text(json.dumps({"quick": True, "points": points}))
    assert main(["report", str(folder)]) == DONE
    capsys.readouterr()
    read = Read((folder / "report.html").read_text(encoding="utf-8"))
    assert read.table("problem")[1:] == [["crack", "0.0001", "0.25"], ["star", "2·10⁻⁶", "0.5"]]
    # The figures of all benchmarks take the pictures that each has left beside them.
    figures = {"topics": {"made": {"error": {"k": 1e-4}}, "stability": {"error": {"wrong": 0.0}}}, "yardstick_s": 1.0}
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "figures.json").write_text(json.dumps(figures))
    (tmp_path / "stability").mkdir()
    for place in (folder, tmp_path / "stability"):
        (place / "map.png").write_bytes(base64.b64decode(DOT))
    assert main(["report", str(tmp_path / "bench")]) == DONE
    capsys.readouterr()
    page = (tmp_path / "bench" / "report.html").read_text(encoding="utf-8")
    assert page.count(DOT) == 2 and Read(page).table("error")
    (folder / "points.json").write_text("{")
    assert main(["report", str(folder)]) != DONE
    assert "points.json is not" in capsys.readouterr().err


def test_no_page_where_none_is_asked(runs, capsys):
    (runs / "one" / "report.html").unlink(missing_ok=True)
    assert main(["report", str(runs / "one"), "--no-page"]) == DONE
    assert main(["report", str(runs / "one"), "--csv"]) == DONE
    assert not (runs / "one" / "report.html").exists()
    capsys.readouterr()
    assert main(["report", str(runs / "nowhere")]) == BAD_INPUT
