"""What a run had no need to do: each kind in words, how often, and about what it would have taken."""

from __future__ import annotations

from typing import Any

from geomech.model import Cycle, Problem, Skip

#: Kinds of work in words, and what spared it.
WORDS = {
    "crack solver": "cycles without the crack solver, which was not even loaded: nothing is cracked, and nothing may be",
    "contact searches": "searches for contacts of a block that is the only one",
    "pair searches": "searches for near pairs of blocks, none of which had moved far enough since the last",
    "factorisations": "factorisations of the blocks' matrix, from which it had hardly changed since the last",
    "bodies": "assemblies of cracked blocks whose cracks had not grown",
    "solutions": "solutions of cracked blocks under a load that had been solved for",
    "left-out solutions": "solutions of cracked blocks whose cracks could not grow, by a bound",
    "scaled solutions": "solutions of cracked blocks under their mean stress, which were scaled from unit ones: their crack "
    "faces were in the states of before",
    "compliances": "compliances of cracked blocks whose crack faces were in the states of before",
    "interior fields": "cycles whose fields inside cracked blocks were not written",
    "series": "cycles whose ParaView files were not written",
}


def skip_summary(name: str, skip: Skip) -> dict[str, Any]:
    """An entry of the summary: ``what`` was not done, its ``count``, and ``saved_s``, about how long it would have
    taken by the mean of those that were done, where some were."""
    entry: dict[str, Any] = {"what": WORDS[name], "count": skip.kept}
    if skip.saved is not None:
        entry["saved_s"] = round(skip.saved, 4)
    return entry


def skipped(problem: Problem, last: Cycle) -> dict[str, dict[str, Any]]:
    """name → entry of all that the solvers of a run to its ``last`` cycle did not do."""
    found = {name: skip_summary(name, skip) for name, skip in last.skips.items()}
    if not last.work and not problem.cracks.n_cracks:
        found["crack solver"] = skip_summary("crack solver", Skip(last.number + 1))
    return {name: found[name] for name in WORDS if name in found}
