"""Static condensation: the boundary of a body eliminated from the equations of its cracks.

With tractions g of a load on the boundary and jumps w at the cracks, the boundary unknowns are u = −A_ΓΓ⁻¹ (g + A_ΓC w).
The traction of the load on closed crack faces is then r − G g, and S = A_CC − G A_ΓC, with

    G = A_CΓ A_ΓΓ⁻¹,

as many numbers as A_CΓ has. With G neither loads, nor stress intensity factors, nor crack strain need the factors of A_ΓΓ:
only u does, and the rows of G of new elements when cracks grow.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .iterative.crack_gmres import BoundaryResponse
from .system.boundary_system import BoundarySystem
from .system.influence_matrix import ElementSet, influence
from .system.row_store import KeptRows, LowRankRows

#: Crack elements whose rows are computed at a time beside a large boundary.
AT_ONCE = 32


def influence_on_boundary(system: BoundarySystem, faces: ElementSet, elements: np.ndarray) -> np.ndarray:
    """(n_boundary_unknowns, …) columns of A_ΓC of some of the crack elements ``faces``."""
    some = faces.take(elements)
    out = influence(system.elements, some, system.nu, system.tol)
    return out if system.anchors is None else system.anchored(out, system.anchors.of_jumps(some))


class Condensed:
    """G (``rows``) and A_ΓC of the crack elements ``faces`` beside the boundary ``system``, whose equations are factored.

    ``before``: those of the same boundary before the cracks grew; ``was`` and ``seen`` (n_elements,): numbers there of the
    elements, and of elements at the same place, −1 where new.
    """

    def __init__(
        self,
        system: BoundarySystem,
        faces: ElementSet,
        before: Condensed | None = None,
        was: np.ndarray | None = None,
        seen: np.ndarray | None = None,
    ):
        self.system, self.faces = system, faces
        self._columns: KeptRows | None = None
        self._rows: KeptRows | LowRankRows | None = None
        if before is None or was is None or seen is None:
            self._rows = KeptRows.whole(self._carried(np.arange(faces.n)), faces)
        else:
            self._rows = before.rows.grown(faces, seen, self._carried)
            if before._columns is not None:
                self._columns = before._columns.grown(faces, was, self._influence)

    def _carried(self, elements: np.ndarray) -> np.ndarray:
        return self._by_parts(elements, lambda part: self.system.carried(self.influence_on(part)))

    def _influence(self, elements: np.ndarray) -> np.ndarray:
        return self._by_parts(elements, lambda part: influence_on_boundary(self.system, self.faces, part).T)

    def _by_parts(self, elements: np.ndarray, rows: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """``rows`` of the ``elements``; beside a large boundary of some at a time, without copies of all."""
        if not self.system.large or len(elements) <= AT_ONCE:
            return rows(elements)
        width = 2 * self.faces.per
        out = np.empty((width * len(elements), self.system.elements.n_unknowns))
        for first in range(0, len(elements), AT_ONCE):
            part = elements[first : first + AT_ONCE]
            out[width * first : width * (first + len(part))] = rows(part)
        return out

    def influence_on(self, elements: np.ndarray) -> np.ndarray:
        """Rows of A_CΓ of some of the crack elements."""
        return self.system.influence_on(self.faces.take(elements), np.arange(self.system.elements.n))

    @property
    def rows(self) -> KeptRows | LowRankRows:
        """G, kept until the body is retired (which may happen while fields inside it are computed)."""
        rows = self._rows
        if rows is None:
            self._rows = rows = KeptRows.whole(self._carried(np.arange(self.faces.n)), self.faces)
        return rows

    @property
    def columns(self) -> KeptRows:
        """A_ΓC, by its columns; kept until they are released."""
        columns = self._columns
        if columns is None:
            self._columns = columns = KeptRows.whole(self._influence(np.arange(self.faces.n)), self.faces)
        return columns

    def columns_of(self, elements: np.ndarray) -> np.ndarray:
        """(…, n_boundary_unknowns) columns of A_ΓC of some of the crack elements, as rows."""
        return self._influence(elements) if self._columns is None else self._columns.of(elements)

    def release(self) -> None:
        """Give up what only growth and the boundary's displacement need, where that is much, and keep G as a product."""
        if self.system.large:
            self.release_columns()
            self.system.release()
            rows = self._rows
            if isinstance(rows, KeptRows):
                self._rows = LowRankRows.of_rows(rows) or rows

    def retire(self) -> None:
        """Give up all that is large: another body, with grown cracks, takes this one's place."""
        if self.system.large:
            self._rows = None
        self.release()

    @property
    def for_growth(self) -> int:
        """Bytes that `release` gives up."""
        if not self.system.large:
            return 0
        m, n = self.system.elements.n_unknowns, self.faces.n_unknowns
        return 8 * m * (m * self.system.is_factored + n * (self._columns is not None))

    def release_columns(self) -> None:
        """Give up A_ΓC, which takes less time to compute again than factors do."""
        self._columns = None

    def first(self, load: np.ndarray) -> np.ndarray:
        """See `unit_load_cache.Reduction`."""
        return load

    def then(self, done: np.ndarray, elements: np.ndarray | None = None) -> np.ndarray:
        """G ``done``, on all crack elements or on some."""
        return self.rows @ done if elements is None else self.rows.of(elements) @ done

    def transposed(self, on_faces: np.ndarray) -> np.ndarray:
        """Gᵀ ``on_faces`` (n_crack_unknowns,) or (n_crack_unknowns, k)."""
        return self.rows.T @ on_faces

    def moved_by(self, w: np.ndarray) -> np.ndarray:
        """A_ΓC ``w``, (n,) or (n, k)."""
        columns = self._columns
        if columns is None:  # released, and not worth keeping for one product
            return self._influence(np.arange(self.faces.n)).T @ w
        return columns.T @ w

    def moved_transposed(self, v: np.ndarray) -> np.ndarray:
        """A_ΓCᵀ ``v`` (n_boundary_unknowns, k), column-major."""
        columns = self._columns
        if columns is not None:
            return columns @ v
        elements, width = np.arange(self.faces.n), 2 * self.faces.per
        out = np.empty((width * len(elements), v.shape[1]), order="F")
        for first in range(0, len(elements), AT_ONCE):
            part = elements[first : first + AT_ONCE]
            out[width * first : width * (first + len(part))] = self._influence(part) @ v
        return out


class Operators:
    """As `Condensed`, where the crack equations are solved iteratively: A_CΓ is ``on_cracks``, and each step applies
    A_ΓΓ⁻¹."""

    def __init__(self, system: BoundarySystem, faces: ElementSet, following: BoundaryResponse, on_cracks: np.ndarray):
        self.system, self.faces, self.on_cracks, self._following = system, faces, on_cracks, following

    #: Bytes that `release` gives up.
    for_growth = 0

    def release(self) -> None:
        """Nothing is large."""

    retire = release

    def influence_on(self, elements: np.ndarray) -> np.ndarray:
        """Rows of A_CΓ of some of the crack elements."""
        return self.on_cracks[self.faces.unknowns(elements)]

    def first(self, load: np.ndarray) -> np.ndarray:
        """A_ΓΓ⁻¹ ``load``."""
        return self.system.solve(load)

    def then(self, done: np.ndarray, elements: np.ndarray | None = None) -> np.ndarray:
        """A_CΓ ``done``, on all crack elements or on some."""
        return (self.on_cracks if elements is None else self.influence_on(elements)) @ done

    def transposed(self, on_faces: np.ndarray) -> np.ndarray:
        """Gᵀ ``on_faces``."""
        return self.system.solve(self.on_cracks.T @ on_faces, transposed=True)

    def moved_by(self, w: np.ndarray) -> np.ndarray:
        """A_ΓC ``w``."""
        return self._following.influence @ w

    def moved_transposed(self, v: np.ndarray) -> np.ndarray:
        """A_ΓCᵀ ``v``."""
        return self._following.influence.T @ v
