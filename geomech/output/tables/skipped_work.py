"""Work that a run could skip: each kind in words, how often, and about how long it would have taken."""

from __future__ import annotations

from typing import Any

from geomech.model import Cycle, Problem, Skip

#: Kinds of work in words, and why they could be skipped.
WORDS = {
    "crack solver": "cycles without the crack solver, which was not loaded: nothing is cracked or may crack",
    "contact searches": "contact searches of a single block",
    "pair searches": "neighbour searches, because no block had moved far enough since the last",
    "factorisations": "factorisations of the blocks' matrix, which had hardly changed since the last",
    "bodies": "assemblies of cracked blocks whose cracks had not grown",
    "solutions": "solutions of cracked blocks under a load already solved for",
    "left-out solutions": "solutions of cracked blocks whose cracks could not grow, by a bound",
    "scaled solutions": "solutions of cracked blocks under their mean stress, scaled from unit solutions, because their "
    "crack faces kept their states",
    "compliances": "compliances of cracked blocks whose crack faces kept their states",
    "interior fields": "cycles whose fields inside cracked blocks were not written",
    "series": "cycles whose ParaView files were not written",
}


def skip_summary(name: str, skip: Skip) -> dict[str, Any]:
    """An entry of the summary: ``what`` was skipped, its ``count``, and the time saved ``saved_s``, by the mean of
    those that were done, if any."""
    entry: dict[str, Any] = {"what": WORDS[name], "count": skip.kept}
    if skip.saved is not None:
        entry["saved_s"] = round(skip.saved, 4)
    return entry


def skipped(problem: Problem, last: Cycle) -> dict[str, dict[str, Any]]:
    """{name: entry} of all work that the solvers of a run skipped up to its ``last`` cycle."""
    found = {name: skip_summary(name, skip) for name, skip in last.skips.items()}
    if not last.work and not problem.cracks.n_cracks:
        found["crack solver"] = skip_summary("crack solver", Skip(last.number + 1))
    return {name: found[name] for name in WORDS if name in found}
