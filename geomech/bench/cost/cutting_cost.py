"""Cost of cutting rock into blocks: networks of 10² to 10⁵ blocks, blocks per second, memory, exponent.

Processor time of one thread, which is less affected by other programs than the clock; the shortest of some repeats. The
result is checked: the blocks' areas add up to the rock's.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ...output.tables.summary import write_json
from ...shapes import Joint, Zone, cut
from ...shapes.joint_networks.joint_sets import Law, parallel_set, poisson_lines, voronoi
from ..figures import Measured
from .block_cost import peak_memory

FOLDER = Path("outputs/bench_geometry")
SIZES = (100, 1000, 10_000, 100_000)
#: Largest size of a quick run.
QUICK = 4000
#: Goals: exponent of the time in the number of blocks, seconds for the largest size.
EXPONENT, SECONDS = 1.15, 10.0
SIDE = 100.0
ROCK = np.array([[0.0, 0.0], [SIDE, 0.0], [SIDE, SIDE], [0.0, SIDE]])


@dataclass(frozen=True)
class Cost:
    """Seconds to make the joints of ``network`` and to cut them; peak ``memory`` of the process so far, MB; ``lost``,
    the relative area of rock that belongs to no block."""

    network: str
    blocks: int
    cracks: int
    repairs: int
    making: float
    cutting: float
    memory: float
    lost: float


def two_sets(n: int, rng: np.random.Generator, share: float = 1.0) -> list[Joint]:
    """Two sets that cross at 80°; the fraction ``share`` of every line is joint."""
    spacing = SIDE / math.sqrt(n)
    out = []
    for name, angle in (("joint:a", 20.0), ("joint:b", 100.0)):
        turn = Law(math.radians(angle), math.radians(3), "normal")
        length, gap = (None, None)
        if share < 1:
            length = Law(6 * spacing, spacing, "normal")
            gap = Law(length.mean * (1 / share - 1), 0.1 * spacing, "normal")
        out.append(parallel_set(name, ROCK, turn, Law(spacing, 0.2 * spacing, "normal"), length, gap, rng))
    return out


#: Networks with about this many blocks.
NETWORKS: dict[str, Callable[[int, np.random.Generator], list[Joint]]] = {
    "two sets": two_sets,
    # Every gap connects the blocks on its sides: 2.5 times the lines for the same number of blocks.
    "with rock bridges": lambda n, rng: two_sets(round(2.5 * n), rng, 0.86),
    "Poisson lines": lambda n, rng: [poisson_lines("joint:a", ROCK, None, math.sqrt(math.pi * n) / SIDE, rng)],
    "Voronoi cells": lambda n, rng: [voronoi("joint:a", ROCK, SIDE**2 / n, rng)],
}


def cost(network: str, n: int, repeats: int) -> Cost:
    """Cost of making ``n`` traces of a ``network`` and cutting rock by them, the least of ``repeats``."""
    making, cutting = [], []
    for _ in range(repeats):
        began = time.process_time()
        joints = NETWORKS[network](n, np.random.default_rng(n))
        made = time.process_time()
        result = cut([Zone("rock", (ROCK,))], joints)
        cutting.append(time.process_time() - made)
        making.append(made - began)
    return Cost(
        network,
        result.blocks.n_blocks,
        result.cracks.n_cracks,
        len(result.repairs),
        min(making),
        min(cutting),
        peak_memory(),
        float(abs(result.blocks.areas().sum() / SIDE**2 - 1)),
    )


def exponent(costs: list[Cost]) -> float:
    """Exponent of the cutting time in the number of blocks, by regression from the second size on: the first is all
    overhead."""
    n, seconds = np.log([c.blocks for c in costs[1:]]), np.log([c.cutting for c in costs[1:]])
    return float(np.polyfit(n, seconds, 1)[0])


def measure(quick: bool = False) -> Measured:
    """The table; writes ``cost_of_size.json`` and ``cost_of_size.png`` to `FOLDER`. ``quick``: up to `QUICK` blocks,
    each size once."""
    from ...render.benchmarks.cost_of_size import draw_cutting

    # The first cut imports common modules.
    cost("two sets", 10, 1)
    costs = [
        cost(network, n, 1 if quick or n > 1000 else 3)
        for n in ((*SIZES[:2], QUICK) if quick else SIZES)
        for network in NETWORKS
    ]
    by_network = {network: [c for c in costs if c.network == network] for network in NETWORKS}
    exponents = {network: exponent(own) for network, own in by_network.items()}
    FOLDER.mkdir(parents=True, exist_ok=True)
    written = {"costs": [asdict(c) for c in costs], "exponents": exponents, "quick": quick}
    write_json(FOLDER / "cost_of_size.json", written)
    draw_cutting(costs, FOLDER / "cost_of_size.png")
    busy = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    lines = [
        f"cutting rock into blocks; processor time of one thread, load average of the machine {busy}",
        "  network              blocks    cracks   joints s    cutting s   blocks/s     peak   area lost",
    ]
    lines += [
        f"  {c.network:<19}{c.blocks:8d}{c.cracks:10d}{c.making:11.3f}{c.cutting:13.3f}{c.blocks / c.cutting:11.0f}"
        f"{c.memory:6.0f} MB{c.lost:11.0e}"
        for c in costs
    ]
    lines += [f"  exponent, {network}: {e:.2f} (goal {EXPONENT:g})" for network, e in exponents.items()]
    if not quick:
        lines.append(f"  the largest size within {max(c.cutting for c in costs):.1f} s (goal {SECONDS:g} s)")
    return Measured.of(
        "\n".join(lines),
        errors={f"{c.network}, {c.blocks} blocks: area lost": c.lost for c in costs},
        times={f"{c.network}, {c.blocks} blocks: cutting": c.cutting for c in costs},
    )
