"""Time against error of coupled runs: what order of elements and number of passes buy, and what neither can."""

from __future__ import annotations

from pathlib import Path

from geomech.bench.accuracy import boundary_stress, pass_tolerance
from geomech.coupling import load_pass


def test_orders_bring_the_error_down_with_tractions_of_faces_only(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    points = boundary_stress.by_order(0, (2, 4))
    error = {(p.method, p.size): p.error for p in points}
    assert error["contacts", 2] < 1e-3 and error["contacts", 4] < 0.1 * error["contacts", 2]
    # Springs leave 0.39 of K_II, Kelvin's field in the infinite plane 0.79, in whatever elements.
    for route in ("springs", "kelvin-springs"):
        assert error[route, 2] > 0.1 and abs(error[route, 4] / error[route, 2] - 1) < 0.02


def test_tighter_passes_are_more_and_nearer_to_the_answer(monkeypatch):
    before = load_pass.COMPLIANCE_TOLERANCE, load_pass.FAILED
    monkeypatch.setattr(pass_tolerance, "TOLERANCES", (1e3, before[0], 1e-8))
    once, usual, tight = pass_tolerance.points()
    assert before == (load_pass.COMPLIANCE_TOLERANCE, load_pass.FAILED)
    assert once.passes == pass_tolerance.STEPS < usual.passes < tight.passes
    assert once.method == pass_tolerance.ONE_PASS and tight.method == pass_tolerance.METHOD
    assert once.error > 10 * usual.error > 10 * tight.error
    # The default leaves as much as its own size.
    assert usual.error < 10 * before[0]
