"""Series of a run as one .vtu file per cycle and series under ``vtk/``, with one PVD list per series."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..fields import SERIES
from .vtu import Collection, Grid, GridFiles

#: Entries of a series: (time in the PVD, file relative to the run folder).
Listed = dict[str, list[tuple[float, str]]]


class VtuStore:
    """Writes the grids of ``names`` below ``folder``, after what is ``listed`` (empty: from the start).

    Files of an earlier run are overwritten, and the remaining ones deleted at the end; with ``resumed``, files later
    than those listed are deleted at once.
    """

    def __init__(self, folder: Path, names: Sequence[str], listed: Listed, *, resumed: bool = False) -> None:
        self._vtk = folder / "vtk"
        self._vtk.mkdir(parents=True, exist_ok=True)
        for name in set(SERIES) - set(names):
            (folder / f"{name}.pvd").unlink(missing_ok=True)
        for name in SERIES:
            (folder / f"{name}.vtkhdf").unlink(missing_ok=True)
        self._collections = {name: Collection(folder / f"{name}.pvd", listed.get(name, ())) for name in names}
        self._files = {name: GridFiles(name) for name in names}
        self._old = self._unlisted()
        if resumed:
            for name in self._old:
                (self._vtk / name).unlink()
            self._old = set()

    @staticmethod
    def missing(folder: Path, listed: Listed) -> list[str]:
        """Files that are listed but do not exist."""
        return [file for entries in listed.values() for _, file in entries if not (folder / file).is_file()]

    def _unlisted(self) -> set[str]:
        """Files of series in ``vtk`` that no collection lists."""
        listed = {file for entries in self.listed().values() for _, file in entries}
        there = {path.name for name in SERIES for path in self._vtk.glob(f"{name}_[0-9]*.vtu")}
        return {name for name in there if f"vtk/{name}" not in listed}

    def listed(self) -> Listed:
        """What has been written, by series."""
        return {name: list(collection.entries) for name, collection in self._collections.items()}

    def count(self, name: str) -> int:
        """Number of written cycles of the series ``name``; 0 if it is not written."""
        return len(self._collections[name].entries) if name in self._collections else 0

    def put(self, name: str, cycle: int, at: float, grid: Grid, numbers: Mapping[str, float | int | bytes]) -> None:
        """Write ``grid`` as the series ``name`` at ``cycle``, listed at the time ``at`` (s), with ``numbers`` as field
        data."""
        file = f"{name}_{cycle:06d}.vtu"
        self._files[name].write(f"{self._vtk}/{file}", grid, numbers)
        self._old.discard(file)
        self._collections[name].add(at, f"vtk/{file}")

    def close(self) -> None:
        """Close the files; the last files of a longer earlier run must not remain among ours."""
        for collection in self._collections.values():
            collection.close()
        for name in self._old:
            (self._vtk / name).unlink(missing_ok=True)
