"""Valid reasons for the refusal of a slope. A refusal with any other message counts as wrong."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ... import dda, ddm


@dataclass(frozen=True)
class Reason:
    """Errors of ``kind`` whose message matches ``pattern``: ``name`` in tables and pictures, ``meaning`` in a sentence;
    ``drawn``: only before anything has moved or grown."""

    name: str
    kind: type[Exception]
    pattern: str
    meaning: str
    drawn: bool = False


REASONS = (
    Reason(
        "sharp corner drawn",
        ValueError,
        r"meet at \(\S+, \S+\) at less than 10°|folds back on itself|leaves the boundary at \(\S+, \S+\) at less than "
        r"3°",
        "cracks as cut meet each other or a surface too sharply to be resolved: they are named, with the place",
        drawn=True,
    ),
    Reason(
        "in-situ stress not found",
        dda.NoInSituEquilibrium,
        r"after \d+ (steps|cuts)",
        "the search for rest under the stress asked for did not end: force out of balance, or contact, are named",
    ),
    Reason(
        "contact states not found",
        dda.NotConverged,
        r"the block step at t = \S+ s failed after \d+ cuts",
        "contacts find no consistent states at any length of the step: the contact, or how far a vertex moves, is "
        "named",
    ),
    Reason(
        "block crushed",
        dda.NotConverged,
        r"is compressed to zero area at t = ",
        "a block's loads are too large for its stiffness: it would have no area",
    ),
    Reason(
        "strained beyond elasticity",
        dda.NotConverged,
        r"is strained by \S+ % at t = \S+ s: beyond linear elasticity",
        "a block that hangs by a thin bridge of rock, or is overloaded, is no longer linear elastic: it is named",
    ),
    Reason(
        "no common strain",
        dda.NotConverged,
        r"do not converge to a common strain in \d+ passes",
        "blocks and the cracks in them agree on no strain at any length of the step: the blocks are named",
    ),
    Reason(
        "energy by overlap",
        dda.NotConverged,
        r"overlapping blocks have created \S+ of all converted energy",
        "blocks that move where nothing holds them have closed a contact while they overlapped: the pair is named",
    ),
    Reason(
        "crack faces not found",
        ddm.NotConverged,
        r"crack faces did not settle|have no contact state that satisfies",
        "the faces of a block's cracks find no consistent states: the block is named",
    ),
)


def reason_of(error: Exception, begun: bool = True) -> str | None:
    """Name of the reason given by ``error``, before or (``begun``) after the first cycle; None if it is none of
    `REASONS`."""
    for reason in REASONS:
        fits = type(error) is reason.kind and not (begun and reason.drawn)
        if fits and re.search(reason.pattern, str(error)):
            return reason.name
    return None
