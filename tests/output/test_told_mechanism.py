"""A static run that went on beyond a mechanism says at its end that its displacements are no answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geomech.coupling import cycles
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from geomech.output import Run, Summary
from geomech.output.console.progress import NO_ANSWER, closing_lines
from geomech.report.run_page import key_results


def slides(friction_deg: float) -> Problem:
    """A block on a level base under a weight that leans by 30°."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return Problem(
        title="slope",
        blocks=Blocks.from_polygons([3 * square - [1, 3], square], fixed=[True, False], names=["base", "slider"]),
        cracks=Cracks.from_polylines([], block=[]),
        materials=(Material("rock", 5e9, 0.25, density=2600.0),),
        joints=(JointLaw("joint", friction_angle=np.radians(friction_deg)),),
        loads=Loads(gravity=History.constant(9.81 * np.array([0.5, -np.sqrt(0.75)]))),
        dda=DdaSettings(time_step=0.01),
        run=RunSettings(end_time=0.1),
    )


def test_the_end_of_a_run_names_the_mechanism(tmp_path: Path):
    for friction, told in ((20.0, True), (40.0, False)):
        summary, given = {}, slides(friction)
        (tmp_path / "history.csv").touch()  # a run has one
        observer = Summary()
        observer.on_start(given, tmp_path)
        for cycle in cycles(given):
            observer.on_cycle(cycle)
        observer.on_end(summary)
        assert any(NO_ANSWER in line for line in closing_lines(summary, tmp_path)) == told
        run = Run(tmp_path)
        vars(run)["led"] = False
        assert (key_results(run)["mind"] == NO_ANSWER) == told
