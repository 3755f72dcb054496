"""The examples in the docstrings of the public Python API run, and print what they say."""

import doctest
import shutil

import numpy as np
import pytest

import geomech
from geomech import dda, ddm, model

SLOPE = """
title = "A block on a plane"
[[geometry.zones]]
name = "plane"
polygon = [[-12, -6.9282], [6, 3.4641], [6, -8], [-12, -8]]
[[geometry.zones]]
name = "block"
polygon = [[2, 1.1547], [4, 2.3094], [3, 4.0415], [1, 2.8868]]
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.plane]
fixed = true
[joints.default]
friction_angle_deg = 35
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
dynamic_factor = 1.0
time_step_s = 0.1
max_displacement_ratio = 0.5
[run]
end_time_s = 0.2
"""

EXAMPLES = {
    "geomech.load_scene": geomech.load_scene,
    "geomech.cycles": geomech.cycles,
    "geomech.run": geomech.run,
    "geomech.open_run": geomech.open_run,
    "geomech.resume": geomech.resume,
    "geomech.factor_of_safety": geomech.factor_of_safety,
    "geomech.safety_report": geomech.safety_report,
    "geomech.dda.run": dda.run,
    "geomech.dda.factor_of_safety": dda.factor_of_safety,
    "geomech.ddm.Body": ddm.Body,
    "geomech.ddm.solve_to": ddm.solve_to,
    "geomech.ddm.propagate": ddm.propagate,
    "geomech.model.Blocks.from_polygons": model.Blocks.from_polygons,
    "geomech.model.Cracks.from_polylines": model.Cracks.from_polylines,
    "geomech.model.JointLaw": model.JointLaw,
    "geomech.model.History": model.History,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A working folder with a scene and two runs of it."""
    folder = tmp_path_factory.mktemp("examples")
    (folder / "slope.toml").write_text(SLOPE, encoding="utf-8")
    geomech.run(folder / "slope.toml", out=folder / "outputs" / "slope")
    shutil.copytree(folder / "outputs" / "slope", folder / "outputs" / "broken_off")
    return folder


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_prints_what_it_says(name, folder, monkeypatch):
    if name == "geomech.open_run":
        pytest.importorskip("pandas")
    monkeypatch.chdir(folder)
    names = {"geomech": geomech, "np": np, "dda": dda, "ddm": ddm} | {n: getattr(model, n) for n in model.__all__}
    finder = doctest.DocTestFinder(recurse=False)
    found = [test for test in finder.find(EXAMPLES[name], name, globs=names) if test.examples]
    assert found, f"the docstring of {name} has no example"
    said: list[str] = []
    failed = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(found[0], out=said.append).failed
    assert not failed, "".join(said)


def test_every_function_of_the_package_itself_has_one():
    public = {f"geomech.{name}" for name in geomech.__all__ if callable(getattr(geomech, name))}
    # An exception needs none, and `geomech.sweep` is a package whose page has examples.
    assert public - {"geomech.SceneError", "geomech.sweep"} <= set(EXAMPLES)
