"""A run in a page: the numbers are the run's, bytes are kept to, nothing leaves the page or gets into it as markup."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil

import numpy as np
import pytest
import synthetic_run as made
from reading import arrays, records_in

from geomech.output import Histories, Run, Series
from geomech.output.run_record import PLACES
from geomech.player.page import player, whole_page, write_player
from geomech.player.recording import NothingToPlay, Recording, evenly
from geomech.report.page import Page


@pytest.fixture(scope="module")
def whole(run_folder):
    return Recording(Run(run_folder)).whole()


def test_frames_hold_what_the_run_wrote(run_folder, whole):
    run = Run(run_folder)
    # Without the two cycles whose field was not written; shown while a run lasts they have an older one.
    assert [frame["cycle"] for frame in whole["frames"]] == [0, 1, 4, 5, 6]
    recording = Recording(run)
    assert recording.cycles(every=True) == list(range(7))
    assert recording.frame(3)["field_cycle"] == 1 and "field_cycle" not in recording.frame(4)
    for frame in whole["frames"]:
        load = made.RATE * frame["time"]
        assert frame["load"] == pytest.approx(load)
        found, mesh = arrays(frame), arrays(whole["meshes"][frame["blocks"]])
        assert found["syy"] == pytest.approx(np.full(3, -load), rel=5e-4)
        grid = run.grid("blocks", frame["cycle"])
        for axis, name in enumerate(("ux", "uy")):
            moved = np.asarray(grid["displacement"])[:, axis]
            assert found[name] == pytest.approx(moved, abs=max(np.ptp(moved), 1e-30) / 65534)
            places = np.asarray(grid.points)[:, axis] - whole["origin"][axis]
            assert mesh["xy"[axis]] == pytest.approx(places, abs=1e-8)
        # The rock has its outline and its hole; platens an outline each.
        assert sorted(mesh["loop_block"].tolist()) == [0, 1, 1, 2]
        assert found["t_k1"] == pytest.approx(np.full(2, -0.0626 * load), rel=1e-6)
        assert found["t_end"].tolist() == [0, 1]
        assert np.abs(found["c_n"]) == pytest.approx(np.full(2, 0.03 * load), rel=5e-4)


def test_files_in_current_coordinates_play_the_same(tmp_path, whole):
    made.write(tmp_path, [Histories(), Series(interior_every=1, configuration="current")])
    moved = Recording(Run(tmp_path)).whole()
    assert len(moved["frames"]) == len(whole["frames"])
    for a, b in zip(moved["frames"], whole["frames"], strict=True):
        mine, theirs = arrays(moved["meshes"][a["blocks"]]), arrays(whole["meshes"][b["blocks"]])
        for name in ("x", "y"):
            assert mine[name] == pytest.approx(theirs[name], abs=1e-8)
        assert arrays(a)["ux"] == pytest.approx(arrays(b)["ux"], abs=1e-9)


def test_cycles_are_thinned_to_the_bytes_given(run_folder):
    full = Recording(Run(run_folder)).whole()
    size = len(json.dumps(full["frames"]))
    thin = Recording(Run(run_folder)).whole(budget=size // 2)
    cycles = [frame["cycle"] for frame in thin["frames"]]
    assert 2 <= len(cycles) < len(full["frames"]) and thin["of"] == len(full["frames"])
    # The ends stay, and the cycle in which the crack began to grow.
    assert cycles[0] == 0 and cycles[-1] == full["frames"][-1]["cycle"]
    assert len(json.dumps(thin["frames"])) < 0.75 * size
    for kind in ("blocks", "interior"):
        assert {frame[kind] for frame in thin["frames"] if kind in frame} <= set(range(len(thin["meshes"])))
    run = Run(run_folder)
    assert 4 in evenly(run, run.history["cycle"].astype(int).tolist(), 4)


def test_a_run_without_cracks_or_without_blocks_plays(run_folder, tmp_path):
    for missing in ("cracks", "tips", "interior"):
        shutil.copytree(run_folder, tmp_path / missing)
        (tmp_path / missing / f"{missing}.pvd").unlink()
    for missing, frames in (("cracks", 5), ("tips", 5), ("interior", 7)):
        assert len(Recording(Run(tmp_path / missing)).whole()["frames"]) == frames
    shutil.copytree(run_folder, tmp_path / "bare")
    for name in ("blocks", "contacts", "interior"):
        (tmp_path / "bare" / f"{name}.pvd").unlink()
    bare = Recording(Run(tmp_path / "bare")).whole()
    assert len(bare["frames"]) == 7 and "blocks" not in bare["frames"][0]
    for name in ("cracks", "tips"):
        (tmp_path / "bare" / f"{name}.pvd").unlink()
    with pytest.raises(NothingToPlay, match=r"bare: nothing has been written that could be drawn"):
        Recording(Run(tmp_path / "bare"))


def test_places_of_monitors_and_bolts(run_folder, tmp_path):
    shutil.copytree(run_folder, tmp_path / "run")
    bolt = {"name": "b 1", "from": [0.0, 0.01], "to": [0.02, 0.01], "ground": True}
    (tmp_path / "run" / PLACES).write_text(
        json.dumps({"monitors": {"top": [0.0, 0.06], "no": [0, 0]}, "bolts": [bolt]})
    )
    opened = Recording(Run(tmp_path / "run")).opening()
    x, y = opened["origin"]
    # A monitor without columns in history.csv has no curve to show.
    assert opened["monitors"] == [{"name": "top", "x": -x, "y": pytest.approx(0.06 - y)}]
    assert opened["bolts"][0]["to"]["ground"] and opened["bolts"][0]["column"] == "bolt:b 1"


def test_a_page_is_closed_to_everything_else(run_folder, tmp_path):
    path = write_player([Run(run_folder)], tmp_path / "page.html")
    text = path.read_text(encoding="utf-8")
    assert len(text) < 1_000_000
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert "default-src 'none'" in policy and "connect-src 'none'" in policy
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy
    assert "http" not in text.replace("http-equiv", "") and "innerHTML" not in text and "eval(" not in text


def test_no_word_of_a_run_becomes_markup(whole):
    evil = '</script><script>alert(1)</script><img src=x onerror="alert(2)">'
    text = whole_page(evil, evil, player([whole | {"title": evil, "name": evil}]))
    assert evil not in text and text.count("<script") == 2 and "<img" not in text
    assert records_in(text)[0]["title"] == evil


def test_a_page_of_tables_plays_runs_in_one_place(whole):
    page = Page("A run")
    page.play([whole])
    assert len(records_in(str(page))) == 1 and "connect-src 'none'" in str(page)
    with pytest.raises(ValueError, match="can play its runs in one place"):
        page.play([whole])
    assert "<script" not in str(Page("Without")) and "script-src" not in str(Page("Without"))


def test_a_notebook_shows_the_page_in_a_frame_of_its_own(run_folder):
    import geomech

    results = geomech.open_run(run_folder)
    shown = results.view(results, height=500)
    text = shown._repr_html_()
    assert text.startswith("<iframe srcdoc=") and 'sandbox="allow-scripts allow-downloads"' in text
    assert "height:500px" in text and text.count("<") == 2
    assert len(records_in(shown.page)) == 2 and "one, one" in repr(shown)
