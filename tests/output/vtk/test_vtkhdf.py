"""A run in VTKHDF files, one a series, read by VTK's own reader and by `Run`, held against the .vtu files of the same run."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic_run as made

from geomech.model import TIP, Cracks
from geomech.output import Run, Series
from geomech.output.fields import SERIES
from geomech.output.reading import read_grid

h5py = pytest.importorskip("h5py")
pv = pytest.importorskip("pyvista")


def written(folder, **options):
    (folder / "history.csv").parent.mkdir(parents=True, exist_ok=True)
    made.write(folder, [Series(interior_every=2, **options)])
    (folder / "history.csv").write_text("cycle\n")
    return Run(folder)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hdf")
    return written(folder / "files"), written(folder / "one", format="vtkhdf")


@pytest.mark.parametrize("name", SERIES)
def test_every_step_reads_back_as_in_the_files(both, name):
    files, one = both
    there = files.grids(name)
    assert list(one.grids(name)) == list(there)
    for cycle, path in there.items():
        a, b = read_grid(path), read_grid(one.grids(name)[cycle])
        assert np.array_equal(a.points, b.points) and np.array_equal(a.cells, b.cells)
        for data, other in ((a.point_data, b.point_data), (a.cell_data, b.cell_data), (a.field_data, b.field_data)):
            assert {*data.keys()} == {*other.keys()}
            for key in list(data):
                assert np.array_equal(data[key], other[key], equal_nan=True) and data[key].dtype == other[key].dtype


@pytest.mark.parametrize("name", SERIES)
def test_vtk_reads_the_same_at_every_time(both, name):
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    files, one = both
    reader = vtkHDFReader()
    reader.SetFileName(str(one.folder / f"{name}.vtkhdf"))
    reader.UpdateInformation()
    steps = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert list(steps) == [time for time, _ in files.series(name)]
    for time, file in files.series(name):
        reader.UpdateTimeStep(time)
        got, expected = pv.wrap(reader.GetOutputDataObject(0)), pv.read(file)
        assert np.array_equal(got.points, expected.points) and got.field_data["TIME"] == expected.field_data["TIME"]
        for field in SERIES[name]:
            data, other = (grid.point_data if field.place == "point" else grid.cell_data for grid in (got, expected))
            assert np.array_equal(data[field.name], other[field.name], equal_nan=True), (field.name, time)


def test_what_does_not_change_is_stored_once(both):
    _, one = both
    with h5py.File(one.folder / "blocks.vtkhdf") as file:
        blocks = file["VTKHDF"]
        assert len(blocks["Points"]) == made.blocks().n_vertices
        assert len(blocks["CellData/block_id"]) == len(blocks["Types"])
        assert len(blocks["PointData/displacement"]) > 3 * len(blocks["Points"])


def test_a_run_goes_on_where_its_checkpoint_was(tmp_path):
    cycles = made.cycles()
    whole = written(tmp_path / "whole", format="vtkhdf")
    series = Series(interior_every=2, format="vtkhdf")
    folder = tmp_path / "resumed"
    folder.mkdir()
    (folder / "history.csv").write_text("cycle\n")
    series.on_start(made.problem(), folder)
    for cycle in cycles[:3]:
        series.on_cycle(cycle)
    memory = series.memory()
    for cycle in cycles[3:5]:  # written after the checkpoint, and lost
        series.on_cycle(cycle)
    series.memory()
    again = Series(interior_every=2, format="vtkhdf")
    again.on_resume(made.problem(), folder, memory)
    for cycle in cycles[3:]:
        again.on_cycle(cycle)
    again.on_end({})
    for name in SERIES:
        grids = Run(folder).grids(name)
        assert list(grids) == list(whole.grids(name))
        for cycle, where in grids.items():
            a, b = read_grid(where), read_grid(whole.grids(name)[cycle])
            for key in list(a.point_data):
                assert np.array_equal(a[key], b[key], equal_nan=True)


def test_a_series_that_runs_empty_keeps_its_arrays(tmp_path):
    bare = {"cracks": Cracks.from_polylines([]), "tips": np.zeros(0, TIP), "faces": None, "bodies": {}}
    series = Series(format="vtkhdf")
    series.on_start(made.problem(), tmp_path)
    series.on_cycle(made.cycle(0, 0, 0, 0))
    series.on_cycle(replace(made.cycle(1, 1, 0, 0), **bare))
    series.on_end({})
    (tmp_path / "history.csv").write_text("cycle\n")
    assert [read_grid(step).n_cells for _, step in Run(tmp_path).series("tips")] == [2, 0]


def test_without_h5py_the_way_out_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    series = Series(format="vtkhdf")
    with pytest.raises(ValueError, match=r"pip install 'geomech\[hdf\]'"):
        series.on_start(made.problem(), tmp_path)
    with pytest.raises(ValueError, match="format must be one of"):
        Series(format="xdmf")
