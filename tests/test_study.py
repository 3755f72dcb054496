"""The runs of a study: which variants, into which folders, seen by whom; nothing is solved here."""

from __future__ import annotations

from pathlib import Path

import pytest

import geomech.pipeline
from geomech.cli import FAILED, main
from geomech.scene import SceneError
from geomech.study import watched_runs

FOLDER = Path(__file__).parents[1] / "pipelines" / "joint_shear"


@pytest.fixture
def ran(monkeypatch):
    """(folder, last observer) of each run that was asked for."""
    asked = []

    def run(scene, out, observers):
        asked.append((out, observers[-1]))
        return {"title": scene.name}

    monkeypatch.setattr(geomech.pipeline, "run", run)
    return asked


def test_every_variant_has_its_folder_and_its_watcher(ran, tmp_path):
    seen = list(watched_runs(FOLDER, tmp_path, object))
    assert len(seen) > 1 and len({id(each.watcher) for each in seen}) == len(seen)
    assert [(each.folder, each.watcher) for each in seen] == ran
    assert all(each.folder == tmp_path / each.name for each in seen)


def test_the_scene_as_it_stands_runs_into_the_folder_itself(ran, tmp_path):
    (only,) = watched_runs(FOLDER, tmp_path, object, [None])
    assert (only.name, only.folder) == (None, tmp_path)


def test_an_error_in_the_last_is_found_before_the_first_is_run(ran, tmp_path):
    with pytest.raises(SceneError, match=r"no such variant|variant"):
        list(watched_runs(FOLDER, tmp_path, object, [None, "nowhere"]))
    assert not ran


def test_a_study_that_misses_what_it_is_held_against_fails(tmp_path, capsys):
    study = tmp_path / "study"
    study.mkdir()
    (study / "run.py").write_text(
        "def main(folder, out, overrides=(), variants=(), quiet=False):\n    assert 2.0 < 1.0, 'the load is off'\n"
    )
    assert main(["run", str(study), "--quiet", "--out", str(tmp_path / "out")]) == FAILED
    assert "the load is off" in capsys.readouterr().err
