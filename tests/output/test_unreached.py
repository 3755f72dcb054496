"""A run that comes to the end of its loads before what it was to stop at says so first: console, summary, log, report."""

from __future__ import annotations

import json
from pathlib import Path

import geomech
from geomech.output import Run, standard_observers
from geomech.output.console.progress import closing_lines
from geomech.report.run_page import key_results

SPECIMEN = """
title = "Strong"
[[geometry.zones]]
name = "rock"
rectangle = [-0.03, -0.06, 0.03, 0.06]
[[geometry.cracks]]
name = "flaw"
centre = [0.0, 0.0]
length_m = 0.01
angle_deg = 45
[[geometry.edges]]
name = "load:top"
line = [[-0.03, 0.06], [0.03, 0.06]]
[[geometry.edges]]
name = "load:bottom"
line = [[-0.03, -0.06], [0.03, -0.06]]
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.2
density_kg_m3 = 2500
k_ic_pa_sqrt_m = 1e9
[cracks.default]
aperture = "slot"
[loads]
leading_edge = "load:top"
[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, -1e6]
[[loads.tractions]]
edge = "load:bottom"
rate_pa_per_s = [0.0, 1e6]
[dda]
max_displacement_ratio = 0.05
time_step_s = {step}
[gauge]
from = [0.0, -0.06]
to = [0.0, 0.06]
zone = "rock"
[run]
end_time_s = {end}
stop_at = {stop_at}
"""


def summary_of(folder: Path, end: float, stop_at: str = '["coalescence", "split"]') -> dict:
    folder.mkdir()
    scene = folder / "scene.toml"
    scene.write_text(SPECIMEN.format(end=end, step=end / 4, stop_at=stop_at), encoding="utf-8")
    scene = geomech.load_scene(scene)
    geomech.run(scene, folder / "out", standard_observers(scene, quiet=True))
    return json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))


def test_it_is_not_told_of_cracks_that_cannot_grow(tmp_path: Path):
    scene = tmp_path / "scene.toml"
    text = SPECIMEN.format(end=4.0, step=2.0, stop_at='["coalescence", "split"]') + "[growth]\nenabled = false\n"
    scene.write_text(text, encoding="utf-8")
    loaded = geomech.load_scene(scene)
    geomech.run(loaded, tmp_path / "out", standard_observers(loaded, quiet=True))
    assert "not_reached" not in json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))


def test_it_is_told_first(tmp_path: Path):
    """At 300 MPa the strain is 1.4 %, by (1 - ν²)/E = 1.44 % and the flaw."""
    summary = summary_of(tmp_path / "strong", 300.0)
    assert list(summary)[:3] == ["title", "end", "not_reached"]
    told = summary["not_reached"]
    assert (
        "no coalescence or split until the last load, 300 MPa and a strain of 1.4 %" in told and "not elastic" in told
    )
    out = tmp_path / "strong" / "out"
    assert closing_lines(summary, out)[1].strip() == told
    log = (out / "run.log").read_text(encoding="utf-8").splitlines()
    assert told in log[-2] and "WARNING" in log[-2] and "ended" in log[-1]
    assert list(key_results(Run(out)))[1] == "but"


def test_others_do_not(tmp_path: Path):
    """At loads that rock bears nothing is said of elasticity; a run that waits for nothing says nothing."""
    assert "not elastic" not in summary_of(tmp_path / "weak", 20.0)["not_reached"]
    assert "not_reached" not in summary_of(tmp_path / "open", 20.0, "[]")
