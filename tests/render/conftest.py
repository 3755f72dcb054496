import sys
from pathlib import Path

import pytest

# The made-up run lives with the tests of what writes it.
sys.path.insert(0, str(Path(__file__).parents[1] / "output"))


@pytest.fixture(scope="session")
def drawn_run(tmp_path_factory):
    import synthetic_run

    from geomech.output import Histories, Run, SceneCopy, Series, Summary

    folder = tmp_path_factory.mktemp("drawn")
    scene = SceneCopy({"title": "Made-up specimen", "render": {"width_px": 500, "deformation_scale": 0.0}})
    synthetic_run.write(folder, [scene, Histories(), Series(interior_every=2), Summary()], steps=6, passes=4)
    return Run(folder)
