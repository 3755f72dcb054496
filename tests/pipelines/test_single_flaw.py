"""The single-flaw study, run as the command line runs it, against closed forms."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from geomech import ddm, load_scene
from geomech.cli import DONE, main
from geomech.model import Cracks
from geomech.output import Run
from geomech.reference.specimens import single_flaw as published

FOLDER = Path(__file__).parents[2] / "pipelines" / "single_flaw"
sys.path.insert(0, str(FOLDER))
from compare_single_flaw import Wings


def run_pipeline(out: Path, *wishes: str) -> SimpleNamespace:
    """`geomech run pipelines/single_flaw`; returns what its own observer saw and its files."""
    seen = []
    ended = Wings.on_end

    def keep(self, summary, error=None):
        ended(self, summary, error)
        seen.append(self)

    Wings.on_end = keep
    try:
        code = main(
            ["run", str(FOLDER), "--quiet", "--out", str(out), *(w for wish in wishes for w in ("--set", wish))]
        )
    finally:
        Wings.on_end = ended
    assert code == DONE
    return SimpleNamespace(wings=seen[-1], out=out, files=Run(out))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """To 42 MPa: wings of 35 mm, which still grow stably."""
    return run_pipeline(tmp_path_factory.mktemp("flaw"), "run.end_time_s=210.0")


def test_run_ends_as_told_and_writes_its_files(study):
    assert study.files.summary["end"] == "end of the scene"
    names = {path.name for path in study.out.iterdir()}
    assert names >= {
        "comparison.txt",
        "report.html",
        "summary.json",
        "events.csv",
        "tips.csv",
        "history.csv",
        "blocks.pvd",
        "cracks.pvd",
    }
    text = (study.out / "comparison.txt").read_text()
    assert "Initiation" in text and "nan" not in text
    page = (study.out / "report.html").read_text(encoding="utf-8")
    assert "Horii &amp; Nemat-Nasser" in page and page.count("data:image/svg+xml") >= 5
    cracks = study.files.grid("cracks", int(study.files.history["cycle"][-1]))
    # The file's crack is as long as the wings that were seen: both wings, and the flaw.
    lengths = cracks.compute_cell_sizes(length=True, area=False, volume=False)["Length"].sum()
    assert lengths >= 2 * study.wings.wing[-1] + 2 * published.HALF_LENGTH


def test_factors_before_growth(study):
    """Of the plate, with elements of order 8: the scene's of order 4 keep three digits. The infinite plane's are lower,
    by what the sides do to a flaw over 35 % of the width: with √sec, 8 %, K_I is 5 % off and K_II as much the other
    way."""
    first = study.wings
    k = np.abs(first.k[0]) / first.load[0]
    assert np.allclose(k, published.OPEN_SLOT, rtol=1e-3)
    corrected = published.secant_correction() * np.array(published.open_slot_in_plane())
    assert np.allclose(k, corrected, rtol=0.06)
    assert (k > published.open_slot_in_plane()).all()
    assert first.k[0, 0] < 0  # an open slot under compression


def test_initiation_at_the_load_that_the_factors_give(verified, study):
    """K_eq = K_Ic, worked out by hand from the maximum tangential stress along the kink (Erdogan & Sih 1963): 32.98
    MPa, to the three digits that elements of the scene's order keep of K."""
    k_i, k_ii = -published.OPEN_SLOT[0], published.OPEN_SLOT[1]
    theta = np.radians(np.arange(0, 180, 0.01))
    hoop = np.cos(theta / 2) * (k_i * np.cos(theta / 2) ** 2 + 1.5 * k_ii * np.sin(theta))
    expected = published.K_IC / hoop.max()
    assert np.degrees(theta[hoop.argmax()]) == pytest.approx(published.KINK_DEG, abs=0.1)
    assert expected == pytest.approx(32.98e6, abs=0.005e6)
    verified(
        "one open slot: load of initiation",
        None,
        "published factors and the criterion",
        found=study.wings.load[0] / 1e6,
        exact=expected / 1e6,
        unit="MPa",
    )
    assert study.wings.load[0] == pytest.approx(expected, rel=1e-3)


def test_wings_leave_at_the_kink_angle(study):
    """Before it grows, a tip tells the angle that K gives: 105.7 degrees, turning the wing to the load."""
    tips = study.files.tips
    before = tips[(tips["load"] < study.wings.load[0]) & (tips["load"] > 0)]
    assert np.allclose(np.abs(before["angle_deg"]), published.KINK_DEG, atol=0.2)
    # The flaw points 60 degrees from the load. At so sharp a kink the criterion is not quite local symmetry, so the
    # path turns on within the first increment, and its chord by two thirds of that: 7 degrees more with 2 mm.
    turn = 90 - published.ANGLE_DEG - study.wings.direction[0]
    assert published.KINK_DEG < turn < published.KINK_DEG + 10


def test_wings_turn_into_the_load_and_stay_without_shear(study):
    """A wing in the load's direction with K_II = 0 (Cotterell & Rice 1980: stable under compression along the crack).
    Chords are solved for to about a degree, K_II to 1 % of K_I, where they go straight on."""
    late = study.wings.wing > 0.025
    assert np.abs(study.wings.direction[late]).max() < 4
    assert np.abs(study.wings.direction[-3:]).max() < 2
    assert np.abs(study.wings.k[late, 1] / study.wings.k[late, 0]).max() < 0.06


def test_growth_is_stable_after_the_first_burst(study):
    """K_I/σ falls with length, so the load rises from increment to increment; closed forms for sliding flaws (Horii &
    Nemat-Nasser 1986, Ashby & Hallam 1986) fall like l^−1/2, and are lower by 20-50 % (open slot, finite width)."""
    wings = study.wings
    stable = wings.stable[1:]
    assert len(stable) > 5
    assert np.array_equal(stable, np.arange(stable[0], len(wings.load)))  # no second burst
    a = published.HALF_LENGTH
    lengths = np.array([1.0, 2.0, 3.0]) * a
    ours = np.array([wings.factor(x) for x in lengths])
    assert (np.diff(ours) < 0).all()
    for closed_form in (published.wing_horii_nemat_nasser, published.wing_ashby_hallam):
        assert ((ours / closed_form(lengths) > 1.1) & (ours / closed_form(lengths) < 1.5)).all()
    slope = np.polyfit(np.log(lengths), np.log(ours), 1)[0]
    assert -0.6 < slope < -0.3


def test_wings_are_alike(study):
    """The specimen is symmetric under half a turn; rounding grows along a path, but stays small beside it."""
    tips = study.files.tips
    last = tips[tips["cycle"] == study.files.history["cycle"][-1]]
    assert len(last) == 2
    assert np.allclose([last["x"].sum(), last["y"].sum()], 0, atol=1e-6)


def test_stiffness_before_growth(verified, study):
    """The dilute slot's, which knows nothing of the sides: they add a tenth to what is 5.5 %."""
    verified(
        "one open slot: tangent modulus of the specimen",
        study.wings.tangent_modulus() / published.tangent_modulus() - 1,
        "plane strain with the slot",
    )
    assert study.wings.tangent_modulus() == pytest.approx(published.tangent_modulus(), rel=0.01)


def test_wings_far_from_the_flaw_feel_its_corners():
    """K of wings three flaw half-lengths long, against finite elements: 1 %, of which 0.3 % are theirs.

    The wings are meshed as grown ones are, in increments. Where the mesh forgets the corner of flaw and wing, K is 13 %
    low however far the tip is.
    """
    problem = load_scene(FOLDER).problem()
    block = int(problem.cracks.block[0])
    rock = problem.materials[problem.blocks.material[block]]
    loops = problem.blocks.loops(block)
    flaw = problem.cracks.nodes[problem.cracks.segments[0]]
    wing = [flaw[1]]
    for corner in np.array(published.WING):
        n = max(1, round(np.hypot(*(corner - wing[-1])) / 2e-3))
        wing.extend(wing[-1] + np.arange(1, n + 1)[:, None] / n * (corner - wing[-1]))
    wing = np.array(wing[1:])
    cracks = Cracks.from_polylines([np.concatenate([-wing[::-1], flaw, wing])], aperture=np.inf)
    cracks = replace(cracks, birth_cycle=np.abs(np.arange(cracks.n_segments) - len(wing)))
    (x0, y0), (x1, y1) = loops[0].min(axis=0), loops[0].max(axis=0)
    ends = np.array([[[x1, y1], [x0, y1]], [[x0, y0], [x1, y0]]])
    press = np.array([[[0, -1.0]] * 2, [[0, 1.0]] * 2])
    tips = ddm.Body(loops, cracks, rock).solve(ddm.BodyLoad(segments=ends, tractions=press)).tips
    assert np.allclose(np.hypot(tips["k_i"], tips["k_ii"]), published.WING_FACTOR, rtol=0.01)


@pytest.mark.slow
def test_to_the_ends_and_whatever_the_increment(tmp_path):
    """Wings reach both ends and cut the specimen in two; the load under which they run there must not depend on the
    increment: 45.79 and 45.70 MPa with 2 and 1 mm, both where the wings are 50 mm long."""
    loads = []
    for increment in (2e-3, 1e-3):
        ran = run_pipeline(tmp_path / f"{increment}", f"growth.increment_m={increment}")
        assert ran.files.summary["end"] == "daylighting"
        assert {"initiation", "daylighting", "split"} <= set(ran.files.summary["first"])
        loads.append(ran.wings.load[ran.wings.run_off])
        # The last 3 mm bend towards the end's surface as it attracts them; the very last step has no tip left to tell.
        shaft = (ran.wings.wing > 0.03) & (ran.wings.tip[:, 1] < published.HEIGHT / 2 - 3e-3)
        assert np.nanmax(np.abs(ran.wings.direction[shaft])) < 4
    assert loads[0] == pytest.approx(loads[1], rel=0.02)
