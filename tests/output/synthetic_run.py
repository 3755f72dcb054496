"""A made-up run whose every number is known in closed form: a specimen between platens, pressed and cracked.

The specimen carries the uniform uniaxial stress −load, so its strain, the displacement of its points and the six
components of its stress follow from Hooke's law; the crack grows by straight increments. No solver is involved.
"""

from __future__ import annotations

import math

import numpy as np

from geomech.model import (
    BOLT,
    CONTACT,
    SLIP,
    STICK,
    TIP,
    Blocks,
    Bolt,
    CrackFaces,
    Cracks,
    Cycle,
    Event,
    Loads,
    Material,
    Problem,
    RunSettings,
    State,
    WaterTable,
)

ROCK = Material("rock", 17e9, 0.21, 2200.0, 2e6)
STEEL = Material("steel", 200e9, 0.3, 7800.0)
#: From the bottom platen, which is fixed, up into the rock.
BAR = Bolt(0, (0.01, -0.065), 1, (0.02, -0.05), 2e7, name="bar")
RATE = 0.2e6  # Pa/s
HALF_LENGTH = 5e-3
TILT = math.radians(45.0)


def blocks() -> Blocks:
    """Bottom platen, a specimen with a notch (concave) and a square hole, top platen: 60 × 120 mm between 10 mm."""
    w, h, t = 0.03, 0.06, 0.01
    outline = np.array([[-w, -h], [w, -h], [w, -0.005], [0.025, 0.0], [w, 0.005], [w, h], [-w, h]])
    hole = np.array([[-0.02, -0.04], [-0.015, -0.04], [-0.015, -0.035], [-0.02, -0.035]])
    return Blocks.from_polygons(
        [
            [np.array([[-w, -h - t], [w, -h - t], [w, -h], [-w, -h]])],
            [outline, hole],
            [np.array([[-w, h], [w, h], [w, h + t], [-w, h + t]])],
        ],
        material=[1, 0, 1],
        fixed=[True, False, False],
        names=["platen bottom", "rock", "platen top"],
    )


def halves() -> tuple[np.ndarray, np.ndarray]:
    """The specimen, notch and hole filled, cut along its axis: its left and its right half."""
    w, h = 0.03, 0.06
    left = np.array([[-w, -h], [0.0, -h], [0.0, h], [-w, h]])
    return left, left + [w, 0.0]


def cracks(grown: int = 0, increment: float = 1e-3) -> Cracks:
    """One flaw at 45° with ``grown`` vertical increments at both its tips."""
    u = np.array([math.cos(TILT), math.sin(TILT)])
    line = [-HALF_LENGTH * u, HALF_LENGTH * u]
    birth = [0]
    for k in range(grown):
        line = [line[0] - [0.0, increment], *line, line[-1] + [0.0, increment]]
        birth = [k + 1, *birth, k + 1]
    made = Cracks.from_polylines([np.array(line)], block=1, names=["flaw"])
    return Cracks(
        made.nodes, made.segments, made.crack, made.block, np.array(birth), made.aperture, made.surface, made.names
    )


def problem(end_time: float = 100.0) -> Problem:
    return Problem(
        title="Made-up specimen",
        blocks=blocks(),
        cracks=cracks(),
        materials=(ROCK, STEEL),
        joints=(),
        loads=Loads(bolts=(BAR,), water=WaterTable(((-1.0, 0.02), (1.0, 0.08)))),
        run=RunSettings(end_time=end_time),
    )


def strain_of(load: float) -> np.ndarray:
    """(xx, yy, xy) of the rock under σyy = −load."""
    return ROCK.compliance() @ np.array([0.0, -load, 0.0])


class UniformBody:
    """The elastic body of the specimen: σyy = −load, displacement ε·x plus a rigid motion that nobody asked for."""

    residual, condition = 1e-7, 20.0
    tips, tip_errors = np.zeros(0, TIP), np.zeros((0, 2))

    def __init__(self, load: float, spin: float = 3e-4) -> None:
        self.load, self.spin = load, spin

    def prepare_fields(self) -> None:
        """Nothing is found iteratively."""

    def fields(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        stress = np.zeros((len(points), 3))
        stress[:, 1] = -self.load
        return stress, self.displacement(points)

    def displacement(self, points: np.ndarray) -> np.ndarray:
        xx, yy, xy = strain_of(self.load)
        x, y = points.T
        rigid = np.stack([0.01 - self.spin * y, -0.02 + self.spin * x], axis=1)
        return np.stack([xx * x + 0.5 * xy * y, 0.5 * xy * x + yy * y], axis=1) + rigid


def placement(points: np.ndarray, load: float, turn: float) -> np.ndarray:
    """Where reference ``points`` of the specimen are: strained about the origin, turned by ``turn``, lifted 1 mm."""
    xx, yy, xy = strain_of(load)
    stretched = points @ (np.eye(2) + np.array([[xx, 0.5 * xy], [0.5 * xy, yy]])).T
    c, s = math.cos(turn), math.sin(turn)
    return stretched @ np.array([[c, -s], [s, c]]).T + [0.0, 1e-3]


def cycle(number: int, load_step: int, growth_pass: int, grown: int, *, turn: float = 0.0, contacts: int = 2) -> Cycle:
    """One cycle at ``load_step`` seconds with ``grown`` increments on the crack."""
    shape, time = blocks(), float(load_step)
    load = RATE * time
    vertices = shape.vertices.copy()
    mine = shape.vertex_block == 1
    vertices[mine] = placement(vertices[mine], load, turn)
    network = cracks(grown)
    stress = np.zeros((3, 3))
    stress[:, 1] = -load
    touching = np.zeros(contacts, CONTACT)
    for k in range(contacts):
        first = shape.vertex_start[1] + k
        row = touching[k]
        row["vertex"], row["edge"], row["block"], row["other"], row["state"] = first, 2, 1, 0, (STICK, SLIP)[k % 2]
        row["position"], row["point"], row["normal"] = float(1 - k), vertices[first], (0.0, 1.0)
        row["normal_force"], row["shear_force"] = 0.03 * load, (-1.0) ** k * 0.01 * load
        row["gap"], row["slip"], row["length"] = -1e-9 * k, 1e-6 * k, 0.03
    bolts = np.zeros(1, BOLT)
    bolts["installed"], bolts["force"], bolts["shear_force"] = number > 0, 1e-3 * load, -1e-4 * load
    tips = np.zeros(len(network.tips), TIP)
    for k, node in enumerate(network.tips):
        out = (1.0 if k else -1.0) * (np.array([0.0, 1.0]) if grown else np.array([1.0, 1.0]) / math.sqrt(2))
        k_i, k_ii = -0.0626 * load, -0.0586 * load
        row = tips[k]
        row["node"], row["end"], row["block"], row["point"], row["direction"] = node, k, 1, network.nodes[node], out
        row["k_i"], row["k_ii"], row["k_eq"], row["angle"] = k_i, k_ii, abs(k_ii) * 1.15, 1.0
        row["grown"] = 1e-3 if growth_pass else 0.0
    at = np.linspace(0.0, 1.0, 5)
    ends = network.nodes[network.segments]
    points = ends[:, None, 0] + at[:, None] * (ends[:, None, 1] - ends[:, None, 0])
    n = network.n_segments
    bow = np.broadcast_to(load * 1e-13 * np.sqrt(at * (1 - at)), (n, 5))
    faces = CrackFaces(
        np.arange(n), points, bow, -2 * bow, np.broadcast_to([-1e3, 5e2], (n, 5, 2)), np.full((n, 5), SLIP)
    )
    events = ()
    if growth_pass == 1 and grown == 1:
        events = (Event("initiation", number, time, load, tuple(tips[0]["point"]), "crack 0"),)
    return Cycle(
        number=number,
        load_step=load_step,
        growth_pass=growth_pass,
        load=load,
        strain=-strain_of(load)[1],
        blocks=shape,
        state=State(time, vertices, np.zeros((3, 6)), stress, np.zeros(3), np.zeros((3, 3)), touching, bolts=bolts),
        cracks=network,
        tips=tips,
        faces=faces,
        bodies={1: UniformBody(load)},
        events=events,
        monitors={"top": np.array([0.0, -1e-9 * load])},
        statistics={"open_close_iterations": 3 + load_step % 2, "dt": 1.0},
        seconds={"dda": 1e-3 * number, "ddm": 2e-3 * number},
    )


def cycles(steps: int = 4, passes: int = 3, **options) -> list[Cycle]:
    """``steps`` load steps, then ``passes`` growth passes at the last load."""
    out = [cycle(k, k, 0, 0, **options) for k in range(steps)]
    out += [cycle(steps - 1 + p, steps - 1, p, p, **options) for p in range(1, passes + 1)]
    return out


def write(folder, observers, steps: int = 4, passes: int = 3, error: BaseException | None = None, **options) -> dict:
    """Feed the made-up run to ``observers`` as a pipeline does, and return the shared summary."""
    summary: dict = {}
    for observer in observers:
        observer.on_start(problem(), folder)
    for each in cycles(steps, passes, **options):
        for observer in observers:
            observer.on_cycle(each)
    for observer in observers:
        observer.on_end(summary, error)
    return summary
