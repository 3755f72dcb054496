"""What a run finds does not depend on the threads of BLAS, nor on what has been run before it in the process."""

import numpy as np
import pytest

from geomech.bench.slopes.random_slopes import scene_text
from geomech.coupling.cycle import Coupling
from geomech.dda.linear_solver.blas_threads import alike, blas_threads, limits
from geomech.scene import load_scene


def run(seed, folder, between=lambda: None):
    """The states, tips and faces of a slope's cycles, as bytes."""
    path = folder / f"{seed}.toml"
    path.write_text(scene_text(seed), encoding="utf-8")
    coupling = Coupling(load_scene(path).problem())
    coupling.between = between
    found = []
    for cycle in coupling.cycles():
        between()
        state, faces = cycle.state, cycle.faces
        parts = [state.time, state.vertices, state.velocity, state.stress, cycle.tips["k_eq"]]
        parts += [] if faces is None else [faces.opening, faces.traction]
        found.append(b"".join(np.ascontiguousarray(part).tobytes() for part in parts))
    return found


def in_use():
    """How many threads each library works on now."""
    now = [limit(1) for limit in limits()]
    for limit, number in zip(limits(), now):
        limit(number)
    return now


@pytest.mark.skipif(not limits(), reason="another BLAS, whose threads are not ours to set")
def test_products_come_out_alike_however_many_threads_there_are(monkeypatch):
    """A run works on one thread, or on as many as the environment says; who takes its cycles keeps his own."""
    matrix, vector = np.random.default_rng(3).normal(size=(800, 400)), np.linspace(0.0, 1.0, 400)

    def products():
        for _ in range(2):
            yield in_use(), (matrix.T @ (matrix @ vector)).tobytes(), np.linalg.solve(matrix[:400], vector).tobytes()

    for asked, number in ((None, 1), ("2", 2)):
        monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
        if asked:
            monkeypatch.setenv("OPENBLAS_NUM_THREADS", asked)
        found = []
        for own in (1, 4):
            with blas_threads(own):
                for each in alike(products()):
                    assert set(in_use()) == {own}
                    found.append(each)
        assert all(set(threads) == {number} for threads, _, _ in found)
        assert len({of[1:] for of in found}) == 1


def test_a_slope_runs_alike_after_another_and_on_other_threads(tmp_path, monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    alone = run(12, tmp_path)
    seen = []
    with blas_threads(4):
        run(34, tmp_path)
        after = run(12, tmp_path, lambda: seen.append(in_use()))
    assert len(alone) > 2 and after == alone
    # Within the run, and where its cycles are taken.
    assert {number for threads in seen for number in threads} == ({1, 4} if limits() else set())
