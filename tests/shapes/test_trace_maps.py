"""Trace maps of real outcrops, held against what fractopo publishes of them (Ovaskainen 2023, Journal of Open Source
Software 8, 5300): nodes, intensities and mean lengths.

The maps stand beside this file with their source. fractopo counts a trace as half of each of its ends, I or Y nodes,
that lie in the area, and prints two decimals.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

from geomech.coupling.crack_cost import crack_cost
from geomech.output.tables.joint_statistics import joint_statistics
from geomech.scene import load_scene
from geomech.shapes import Joint, Zone, cut
from geomech.shapes.block_cutting.rock_outline import rock_of

MAPS = Path(__file__).parent / "maps"

SCENE = """title = "map"
[geometry]
tolerance_m = 1e-3
[[geometry.zones]]
name = "rock"
polygon = {area}
[[geometry.traces]]
file = "traces.csv"
[materials.rock]
youngs_modulus_pa = 1e10
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6
[joints.default]
friction_angle_deg = 30
[dda]
time_step_s = 1e-3
[run]
end_time_s = 0.1
"""


def points_of(steps: list[int], unit: float) -> np.ndarray:
    return unit * np.cumsum(np.reshape(steps, (-1, 2)), axis=0)


def loaded(name: str, folder: Path):
    """What is published of the map, and its scene."""
    told = json.loads((MAPS / f"{name}.json").read_text(encoding="utf-8"))
    area = points_of(told["area"], told["unit_m"])[:-1]
    rows = ["trace,x,y"]
    for k, steps in enumerate(told["traces"]):
        rows += [f"{k},{x:.4f},{y:.4f}" for x, y in points_of(steps, told["unit_m"]).tolist()]
    (folder / "traces.csv").write_text("\n".join([*rows, ""]))
    path = folder / "scene.toml"
    path.write_text(SCENE.format(area=np.round(area, 4).tolist()))
    return told["published"], load_scene(path)


@pytest.mark.parametrize("name", ["kb7", "getaberget", "kb11"])
def test_statistics_are_those_that_fractopo_publishes(tmp_path, name):
    published, scene = loaded(name, tmp_path)
    blocks = scene.drawing.blocks
    (entry,) = joint_statistics(scene, scene.problem(), np.ones(blocks.n_blocks, bool))
    assert blocks.areas().sum() == pytest.approx(published["area_m2"], rel=1e-5)
    nodes = scene.drawing.jointed.cutting.nodes
    # Of KB11 two traces of the file leave the area and come back, and count twice there.
    assert abs(entry["traces"] - published["traces"]) <= 2
    for kind in ("i", "y", "x"):
        assert nodes[kind.upper()] == pytest.approx(published[f"{kind}_nodes"], rel=0.01), kind
    for key in ("p20_per_m2", "p21_per_m", "mean_length_in_window_m"):
        assert entry[key] == pytest.approx(published[key], abs=0.0051), key
    # Its printed nodes and area say more digits of P20, and of the mean length that no window biases.
    lines = 0.5 * (published["i_nodes"] + published["y_nodes"])
    assert entry["p20_per_m2"] == pytest.approx(lines / published["area_m2"], rel=0.005)
    assert entry["mean_length_m"] == pytest.approx(entry["p21_per_m"] * published["area_m2"] / lines, rel=0.005)


def test_memory_of_many_cracked_blocks(tmp_path):
    """KB11 has 139 cracked blocks: 17 GB as long as each kept A_ΓΓ and its factors; now 7, and 9 more if cracks grew in
    all of them."""
    _, scene = loaded("kb11", tmp_path)
    cost = crack_cost(scene.problem())
    m, n = cost.on_sides.astype(float), cost.on_cracks.astype(float)
    assert len(cost.blocks) == 139
    assert cost.memory < 0.45 * 8 * np.sum(2 * m * m + 2 * m * n + 4 * n * n)


#: A slope cut out of KB11, and the fixed rock below and behind it.
SLOPE = [[24, 6.5], [34, 6.5], [20, 33], [11, 33], [11, 29], [12.5, 23], [16, 18], [20, 14]]
BASE = [
    [34, 5.5],
    *SLOPE[1::-1],
    *SLOPE[:3:-1],
    SLOPE[3],
    [10, 33],
    [10, 29],
    [11.5, 23],
    [15, 18],
    [19, 14],
    [23, 5.5],
]
#: The slope under its weight. Its crack faces are smooth: with the friction of the joints a run takes half as long again.
MOVING = f"""[cracks.default]
aperture = "closed"
[[geometry.zones]]
name = "base"
polygon = {BASE}
[zones.base]
fixed = true
[loads]
gravity_m_s2 = [0, -9.81]
"""
STEPS = """import resource, sys
from geomech.coupling.cycle import Coupling
from geomech.scene import load_scene
problem = load_scene(sys.argv[1]).problem()
print(problem.blocks.n_blocks, problem.cracks.n_cracks)
for cycle in Coupling(problem).cycles():
    if cycle.number in (6, 66) or cycle.state.time > problem.run.end_time - 1e-9:
        of = cycle.work
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        print(cycle.number, cycle.state.time, of["contact_solves"], of["crack_factorisations"], of["solutions"],
              of["solutions_left_out"], of["solutions_scaled"], peak, flush=True)
"""


def printed(script: str, scene: Path) -> list[str]:
    """What ``script`` prints about ``scene``, in a process of its own, whose memory is measured."""
    run = subprocess.run(
        [sys.executable, "-c", script, str(scene)],
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        check=True,
    )
    return run.stdout.splitlines()


@pytest.mark.slow
def test_a_second_of_a_section_in_motion(tmp_path):
    """207 blocks, 119 cracks, 48 cracked blocks, weight applied at once, a second in 1000 steps: 150 to 170 s of
    processor time and 1.9 GB. (5.8 GB after five steps as long as blocks kept A_ΓΓ, its factors and all loads; half an hour as long as
    all blocks were solved in every step, with 300 states of crack faces and 10 factorisations a step.)"""
    loaded("kb11", tmp_path)
    path = tmp_path / "scene.toml"
    scene = SCENE.format(area=SLOPE).replace("k_ic_pa_sqrt_m = 1e6", "k_ic_pa_sqrt_m = 1e9")
    scene = scene.replace("[[geometry.traces]]\n", '[[geometry.traces]]\nzones = ["rock"]\n')
    scene = scene.replace("end_time_s = 0.1", "end_time_s = 1.0")
    path.write_text(scene.replace("[dda]\n", "[dda]\ndynamic_factor = 1.0\n") + MOVING)
    lines = printed(STEPS, path)
    first, early, late, last = (list(map(float, line.split())) for line in lines)
    assert first[:2] == [207, 119]
    assert last[1] == pytest.approx(1.0) and 900 < last[0] < 1100
    assert last[7] < 2.0e9

    def of_a_step(to: list[float], since: list[float]) -> list[float]:
        """States of crack faces, factorisations, solutions that were made and left out, a step."""
        return [(to[k] - since[k]) / (to[0] - since[0]) for k in (2, 3, 4, 5)]

    # While blocks settle, and in all, after the bounds are known.
    states, factorised, solved, left_out = of_a_step(late, early)
    assert states < 130 and factorised < 1 and solved < 45 and left_out > 45
    states, factorised, solved, left_out = of_a_step(last, early)
    assert states < 20 and factorised < 0.1 and solved < 8 and left_out > 47


GROWTH = """import resource, sys
import numpy as np
from geomech.coupling.cycle import Coupling
from geomech.scene import load_scene
coupling, before = Coupling(load_scene(sys.argv[1]).problem()), {}
for cycle in coupling.cycles():
    of = cycle.work
    now = [of[name] for name in ("crack_factorisations", "solutions", "solutions_left_out", "elements_assembled")]
    if cycle.growth_pass > 6:
        print(*(a - b for a, b in zip(now, before)), cycle.statistics["open_close_iterations"], flush=True)
    before = now
    if cycle.growth_pass == 12:
        break
(grown,) = (of for of in coupling.now.solutions.values() if of.body.cracks.birth_cycle.any())
fresh = grown.body.remeshed(grown.body.settings).solve(grown.load, warm=grown)
k, whole = (np.stack([of.tips["k_i"], of.tips["k_ii"]]) for of in (grown, fresh))
print(np.abs(k - whole).max() / np.abs(whole).max())
print(grown.body.n_unknowns, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


@pytest.mark.slow
def test_a_crack_of_a_section_grows_through_many_passes_of_a_step(tmp_path):
    """The section with K_Ic = 1 MPa√m in increments of 1.13 mm: a crack of a block with 3 000 unknowns grows through twelve
    passes of the first step, which solve this block three times each and leave 47 others alone (0.5 s of processor time
    each; 2.4 s as long as the influence of all its cracks on the boundary was computed again, and contacts found from the
    beginning of the step). K is that of the body made anew."""
    loaded("kb11", tmp_path)
    path = tmp_path / "scene.toml"
    scene = SCENE.format(area=SLOPE).replace("[[geometry.traces]]\n", '[[geometry.traces]]\nzones = ["rock"]\n')
    scene = scene.replace("[dda]\n", "[growth]\nincrement_m = 1.13e-3\n[dda]\ndynamic_factor = 1.0\n")
    path.write_text(scene + MOVING)
    lines = printed(GROWTH, path)
    *passes, (error,), (unknowns, peak) = (list(map(float, line.split())) for line in lines)
    assert len(passes) == 6 and unknowns > 2500
    factorised, solved, left_out, elements, iterations = np.mean(passes, axis=0)
    assert factorised <= 3 and solved < 5 and left_out == 47 and elements < 5 and iterations < 3
    assert error < 1e-8
    assert peak < 2.0e9


FROM_REST = """import logging, resource, sys
from geomech.coupling.cycle import Coupling
from geomech.scene import load_scene
logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stdout)
problem, kinds, passes = load_scene(sys.argv[1]).problem(), [], 0
for cycle in Coupling(problem).cycles():
    kinds += [event.kind for event in cycle.events]
    passes += cycle.growth_pass > 0  # without asking for tips, for which all cracked blocks would be solved
use = resource.getrusage(resource.RUSAGE_SELF)
print(cycle.state.time, passes, kinds.count("initiation"), kinds.count("split"), cycle.statistics["kinetic_energy"],
      cycle.statistics["overlap_energy"], cycle.statistics["gravity_work"], use.ru_utime + use.ru_stime, use.ru_maxrss * 1024)
"""


@pytest.mark.slow
def test_a_second_of_a_section_whose_cracks_grow(tmp_path):
    """From rest under its weight, K_Ic = 2 MPa√m, increments of 5 cm, `grading_layers` = 0: thirteen cracks grow for 5 ms
    and cut blocks into seven more, which come to rest: 190 s of processor time, 1.6 GB. (It ended at 21.5 ms as long as a
    corner that slid past a node of a face that does not fit counted as overlap, and the blocks at rest did not agree with
    their cracks in 20 searches for equilibrium, as each began with the blocks as drawn.)"""
    loaded("kb11", tmp_path)
    path = tmp_path / "scene.toml"
    scene = SCENE.format(area=SLOPE).replace("k_ic_pa_sqrt_m = 1e6", "k_ic_pa_sqrt_m = 2e6")
    scene = scene.replace("[[geometry.traces]]\n", '[[geometry.traces]]\nzones = ["rock"]\n')
    scene = scene.replace("end_time_s = 0.1", "end_time_s = 1.0\nstop_at = []")
    tables = (
        '[ddm]\ngrading_layers = 0\n[growth]\nincrement_m = 0.05\n[dda]\nequilibrium = "start"\ndynamic_factor = 1.0\n'
    )
    path.write_text(scene.replace("[dda]\n", tables) + MOVING)
    *warnings, end = printed(FROM_REST, path)
    assert not any("do not converge" in line or "overlap" in line for line in warnings)
    time, passes, started, divided, kinetic, overlap, work, _, peak = map(float, end.split())
    assert time == pytest.approx(1.0)
    assert 3 < passes < 60 and started > 8 and divided > 4
    assert kinetic < 1e-6 * work and overlap < 1e-3 * work
    assert peak < 2.0e9


def test_the_rock_of_many_blocks_has_no_seams():
    """A ring cut by lines of any direction: corners lie on their neighbours' sides but for round-off, and a plain union
    keeps slits there."""
    rng = np.random.default_rng(5)
    angle = np.linspace(0, 2 * np.pi, 60)[:-1]
    outer = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.8, 1.2, 59)[:, None]
    lines = [
        np.stack([p - 5 * way, p + 5 * way]) for p, way in zip(rng.uniform(-1, 1, (40, 2)), rng.normal(size=(40, 2)))
    ]
    ring = shapely.Polygon(outer, [0.3 * outer])
    blocks = cut([Zone("rock", (outer, 0.3 * outer))], [Joint("joint:a", tuple(lines))]).blocks
    polygons = [shapely.Polygon(own[0], own[1:]) for own in map(blocks.loops, range(blocks.n_blocks))]
    rock = rock_of(blocks)
    assert blocks.n_blocks > 200 and len(shapely.union_all(polygons).interiors) > 1
    assert rock.geom_type == "Polygon" and len(rock.interiors) == 1
    assert rock.area == pytest.approx(ring.area, rel=1e-12)
