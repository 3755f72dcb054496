"""What runs come to: a block that slides, by closed forms; the page of a sweep; folders that are kept."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.reference.slopes.rock_slopes import plane_failure_factor
from geomech.report import write_sweep_page
from geomech.sweep.engine import LocalEngine
from geomech.sweep.execution import carry_out_sweep, read_sweep
from geomech.sweep.measures import Job, carry_out, moved_cells, places_of
from geomech.sweep.plan import plan_of

FRICTION = "joints.default.friction_angle_deg"
#: Of the block of the scene, m²; its plane dips by 30°.
AREA = 0.5 * abs(10 * 9 - 5.7735027 * 10 + 10 * 9 - 9 * 6)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Five frictions, their factors of safety in rows; one worker, so that little is loaded twice."""
    from .conftest import PLANE

    folder = tmp_path_factory.mktemp("swept")
    scene = folder / "plane.toml"
    scene.write_text(PLANE, encoding="utf-8")
    settings = {"vary": {FRICTION: [25, 28, 32, 35, 0]}, "keep": "failed", "columns": {"tangent": "tan(radians(30))"}}
    return carry_out_sweep(plan_of(scene, settings), folder / "out", LocalEngine(1))


def test_factors_of_safety_are_those_of_limit_equilibrium(swept):
    """tan φ/tan 30°, within half of the bracket of 2e-3; a strength of nothing has no factor, and is counted so."""
    *rows, last = swept.rows
    for row in rows:
        exact = plane_failure_factor(1.0, math.radians(30), 1.0, 0.0, math.radians(row[FRICTION]))
        assert row["factor_of_safety"] == pytest.approx(exact, rel=1e-3)
        assert row["lower"] <= row["factor_of_safety"] <= row["upper"] and not row["is_bound"]
        assert row["fails"] is (exact < 1)
        assert (row["mechanism"], row["moving_blocks"], row["blocks"]) == ("sliding", 1, 2)
        assert row["moved_volume"] == pytest.approx(AREA, rel=1e-6)
        assert row["moved_mass"] == pytest.approx(2600 * AREA, rel=1e-6)
        assert row["tangent"] == pytest.approx(math.tan(math.radians(30)))
    assert (last["status"], last["fails"]) == ("refused", None)
    sure = swept.probability
    assert (sure.failures, sure.answered, sure.runs) == (2, 4, 5)
    assert "1 refused" in swept.text() and "2 of 4" in swept.text()


def test_tables_hold_what_the_rows_do(swept):
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(swept.folder / "runs.parquet").to_pydict()
    assert table["run"] == [0, 1, 2, 3, 4]
    assert table["factor_of_safety"] == [row.get("factor_of_safety") for row in swept.rows]
    header, *lines = (swept.folder / "runs.csv").read_text(encoding="utf-8").splitlines()
    assert header.split(",") == list(table) and len(lines) == 5
    assert "seconds" not in table and "seconds" in (swept.folder / "times.csv").read_text(encoding="utf-8")


def test_folders_are_kept_of_failures_alone(swept):
    kept = sorted(int(place.name) for place in (swept.folder / "runs").iterdir())
    # Two slopes fail, and one run has no answer.
    assert kept == [0, 1, 4]
    told = json.loads((swept.folder / "runs" / "000001" / "sweep_run.json").read_text(encoding="utf-8"))
    assert told["changes"] == [f"{FRICTION}=28"]
    assert json.loads((swept.folder / "runs" / "000001" / "safety.json").read_text(encoding="utf-8"))["moving"]


def test_the_page(swept):
    page = write_sweep_page(swept.folder).read_text(encoding="utf-8")
    for told in (
        "probability of failure", "Wilson", "Convergence", "Sensitivities", "Responses", "Moving region",
        "Mechanisms", "Typical, worst and median run", "Runs without a result", "Computing time",
        f"--set {FRICTION}=0", "Only 2 runs failed", "1 runs have no result",
    ):  # fmt: skip
        assert told in page, told
    assert page.count("data:image/svg+xml") >= 3 and page.count("data:image/png") >= 3
    assert {"worst", "median", "typical"} == set(read_sweep(swept.folder).pictures)


def test_the_command_line_reports_and_repeats_a_run(swept, capsys, tmp_path):
    assert main(["report", str(swept.folder), "--out", str(tmp_path / "page.html")]) == DONE
    assert "2 of 4" in capsys.readouterr().out and (tmp_path / "page.html").stat().st_size > 20_000
    words = swept.plan.how_to_repeat({FRICTION: 32}).split()
    assert main([*words[1:], "--quiet"]) == DONE
    assert f"factor of safety {swept.rows[2]['factor_of_safety']:.4f}" in capsys.readouterr().out


def test_a_block_that_slides_goes_as_far_as_it_falls(plane):
    """½ g (sin ψ − cos ψ tan φ) t² in t = 0.3 s; Shi's scheme, of first order, adds half a step: 1 + dt/t."""
    plane.write_text(
        plane.read_text(encoding="utf-8").replace("dynamic_factor = 0.0\ntime_step_s = 0.01", "dynamic_factor = 1.0\ntime_step_s = 0.003")
        .replace("end_time_s = 0.02", "end_time_s = 0.3")
        # The floor lies below the toe, which would run into it.
        .replace("[0, 0], [-4, 0]]", "[0, 0], [0, -2], [-4, -2]]"), encoding="utf-8",
    )  # fmt: skip
    columns = {
        "fastest": "max(history.kinetic_energy)",
        "longest": "last(history.time)",
        "done": "energy.kinetic_energy",
    }
    plan = plan_of(plane, {"vary": {FRICTION: [5, 40]}, "measure": "run", "columns": columns})
    slides, stands = (
        carry_out(Job(k, str(plane), None, plan.changes(values), plan.settings, plan.box, plan.cells))
        for k, values in enumerate(plan.table)
    )
    assert (slides["status"], stands["status"]) == ("done", "done"), slides["reason"]
    dip = math.radians(30)
    way = 0.5 * 9.81 * (math.sin(dip) - math.cos(dip) * math.tan(math.radians(5))) * 0.3**2
    assert slides["largest_displacement_m"] == pytest.approx(way * 1.01, rel=0.01)
    assert slides["run_out_m"] == pytest.approx(slides["largest_displacement_m"] * math.cos(dip), rel=0.01)
    assert slides["moving_blocks"] == 1 and slides["fails"] and slides["moved_volume"] == pytest.approx(AREA, rel=1e-6)
    assert stands["moving_blocks"] == 0 and stands["fails"] is False and stands["run_out_m"] == 0.0
    assert slides["longest"] == pytest.approx(0.3) and slides["fastest"] == pytest.approx(slides["done"])
    assert moved_cells(slides["_places"], plan.cells).any() and not moved_cells(stands["_places"], plan.cells).any()


def test_places_are_those_inside_the_outlines():
    triangle = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
    found = moved_cells(places_of([triangle], (0.0, 0.0, 4.0, 4.0), (40, 40)), (40, 40))
    y, x = (np.indices((40, 40)) + 0.5) / 10
    # Middles on the slanted side itself may fall either way.
    clear = np.abs(x + y - 4) > 1e-9
    assert np.array_equal(found[clear], (x + y < 4)[clear])
    assert not moved_cells(places_of([], (0, 0, 1, 1), (5, 3)), (5, 3)).any()
