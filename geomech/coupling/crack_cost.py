"""Memory and time that the cracked blocks of a problem need, estimated from their numbers of elements.

A block with m unknowns on its outline and n on its cracks stores A_CΓ A_ΓΓ⁻¹ (m n numbers), S and factors of its states
(4 n²); while its cracks grow, factors of A_ΓΓ and A_ΓC as well (m² + m n), and S and its factors with room for more (4 n²).
Of many blocks those with more than `KEPT_BESIDE_FACTORS` unknowns on their outline store A_CΓ A_ΓΓ⁻¹ as a product (half as many
numbers) and hardly more factors than those of one state (2.5 n², `PRODUCT` and `STATES`, measured on a trace map); of
factors of A_ΓΓ they keep no more than `FOR_GROWTH` bytes together. It takes ⅔ m³ + 2 m² n + 2 m n² + ⅔ n³ multiplications to
set up. Memory and time of iterative solutions are proportional to m + n
(`ddm.iterative.gmres`, `ddm.iterative.boundary_gmres`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..ddm.iterative.boundary_gmres import CROSSOVER as MANY_ON_SIDES
from ..ddm.iterative.crack_gmres import CROSSOVER as MANY_ON_CRACKS
from ..ddm.mesh.elements import mesh
from ..ddm.system.boundary_system import KEPT_BESIDE_FACTORS
from ..model import Problem, counted
from .load_transfer.elastic_bodies import FOR_GROWTH, MANY

#: Multiplications per second of dense factorisation, and bytes and seconds per unknown of iterative solutions; rough
#: values for one thread, good to a factor of two or three.
RATE, BYTES, SECONDS = 1.5e10, 4e4, 3e-4
#: Parts of m n and n² numbers that one of many blocks stores.
PRODUCT, STATES = 0.5, 2.5
#: Number of unknowns of one block from which the cause of its size is reported.
LARGE = 3000
#: An outline counts as digitised too finely if it has more than this many times 4 `elements_per_side` sides.
FINE = 5


class CrackCost(NamedTuple):
    """Cracked ``blocks`` (numbers), their unknowns ``on_sides`` and ``on_cracks`` and numbers of ``sides``, (n,) each;
    ``memory`` in bytes, what they need ``growing`` besides if cracks grow in all of them, and ``seconds`` of processor
    time to set them up."""

    blocks: np.ndarray
    on_sides: np.ndarray
    on_cracks: np.ndarray
    sides: np.ndarray
    memory: float
    growing: float
    seconds: float


def crack_cost(problem: Problem) -> CrackCost:
    """Cost of the moving blocks of ``problem`` with cracks, without unbounded bodies. Raises ValueError if rock is too
    thin for elements."""
    blocks, cracks = problem.blocks, problem.cracks
    rigid = np.array([material.rigid for material in problem.materials], bool)
    cracked = np.unique(cracks.block) if problem.endless is None else np.zeros(0, int)
    cracked = cracked[~(blocks.fixed | rigid[blocks.material])[cracked]]
    counts, memory, growing, seconds, factors = np.zeros((len(cracked), 3), int), 0.0, 0.0, 0.0, 0.0
    for k, block in enumerate(cracked.tolist()):
        loops = blocks.loops(block)
        made = mesh(loops, cracks.take(np.flatnonzero(cracks.block == block)), problem.ddm)
        m, n = made.boundary.n_unknowns, made.cracks.n_unknowns
        counts[k] = m, n, sum(map(len, loops))
        dense = [(m, MANY_ON_SIDES), (n, MANY_ON_CRACKS)]
        a, b = (size if size < many or problem.ddm.solver == "dense" else 0 for size, many in dense)
        of_many = a > KEPT_BESIDE_FACTORS and len(cracked) >= MANY
        memory += 8.0 * (PRODUCT * a * b + STATES * b * b if of_many else a * b + 4 * b * b) + BYTES * (m + n - a - b)
        if of_many:
            factors += 8.0 * a * a
        else:
            memory += 8.0 * (a * a * (1 if a > KEPT_BESIDE_FACTORS else 2) + a * b)
        growing += 8.0 * 4 * b * b
        seconds += (2 * a**3 / 3 + 2 * a * a * b + 2 * a * b * b + 2 * b**3 / 3) / RATE + SECONDS * (m + n - a - b)
    on_sides, on_cracks, sides = counts.T
    return CrackCost(cracked, on_sides, on_cracks, sides, memory, growing + min(factors, FOR_GROWTH), seconds)


def cost_lines(problem: Problem, cost: CrackCost | None = None) -> list[str]:
    """Lines that state the `crack_cost` of ``problem`` (``cost``, if known); none without cracked blocks."""
    if not problem.cracks.n_cracks or problem.endless is not None:
        return []
    cost = crack_cost(problem) if cost is None else cost
    if not len(cost.blocks):
        return []
    most = int(np.argmax(cost.on_sides + cost.on_cracks))
    name = problem.blocks.names[cost.blocks[most]]
    each = f" (most in {name}: {cost.on_sides[most]} and {cost.on_cracks[most]})" if len(cost.blocks) > 1 else ""
    lines = [
        f"{counted(len(cost.blocks), 'cracked block')}, {cost.on_sides.sum()} unknowns on sides, {cost.on_cracks.sum()} "
        f"on cracks{each}: about {cost.memory / 1e9:.2g} GB, up to {cost.growing / 1e9:.2g} GB besides where cracks grow, "
        f"{cost.seconds:.2g} s of processor time to set up, a part of which again for every change of cracks"
    ]
    per_block = 4 * FINE * problem.ddm.elements_per_side
    if cost.on_sides[most] + cost.on_cracks[most] > LARGE and cost.sides[most] > per_block:
        lines.append(
            f"{name} has {cost.sides[most]} sides: if they were digitised more finely than needed, set simplify_m in "
            "[[geometry.traces]] to drop vertices within that distance"
        )
    if cost.on_sides[most] + cost.on_cracks[most] > LARGE and problem.ddm.grading_layers:
        lines.append(
            f"{name} needs fewer elements with ddm.grading_layers = 1 (K of digitised cracks within 0.3 %) or 0 (2 %, about a "
            "third of the memory)"
        )
    return lines
