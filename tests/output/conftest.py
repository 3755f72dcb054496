import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory):
    """A made-up run written by every observer: 4 load steps, 3 growth passes, interior fields every 2 cycles."""
    import io

    import synthetic_run

    from geomech.output import Histories, Progress, RunLog, Series, Summary

    folder = tmp_path_factory.mktemp("run")
    observers = [RunLog(), Histories(), Series(interior_every=2), Summary(), Progress(stream=io.StringIO())]
    synthetic_run.write(folder, observers)
    return folder
