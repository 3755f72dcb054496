"""The pressure on a joint face that has the force and moment of its contacts and pulls nowhere.

A resultant in the middle third is the linear pressure on the whole length. Nearer to an end it would pull at the other
one; it is then what a no-tension face does, a triangle on a shorter length, as a mixture of two triangles of fixed
lengths, so that a body meets the same few loads again and again. At the very end all of it is a lone force, as it is
when the contact there is the only one that is left: the pressure goes over into it without a jump, which would leave
blocks and cracks no state to settle in.
"""

from __future__ import annotations

#: Triangles are on 1/n, 2/n … of a face's length.
TRIANGLES = 8

Piece = tuple[float, float, float, float]


def no_pull(length: float, force: float, moment: float) -> tuple[list[Piece], float, float]:
    """Pieces (start, end, p_start, p_end) of a pressure on [0, length], linear on each (they add up), and lone forces
    at its start and at its end, all together with resultant ``force`` and ``moment`` about 0.

    None of it is negative where the force is positive and its line of action meets the face; a resultant outside cannot
    be carried without pull and stays linear, pull and all, since force and moment come first.
    """
    arm = moment / force if force > 0 else -1.0
    if 0 <= arm < length / 3:
        pieces, lone = _near_end(length, force, arm)
        return [(0.0, reach, peak, 0.0) for reach, peak in pieces], lone, 0.0
    if 0 <= length - arm < length / 3:
        pieces, lone = _near_end(length, force, length - arm)
        return [(length - reach, length, 0.0, peak) for reach, peak in pieces], 0.0, lone
    return [linear(length, force, moment)], 0.0, 0.0


def linear(length: float, force: float, moment: float) -> Piece:
    """The pressure linear on [0, length] with resultant ``force`` and ``moment`` about 0."""
    return 0.0, length, (4 * force * length - 6 * moment) / length**2, (6 * moment - 2 * force * length) / length**2


def _near_end(length: float, force: float, arm: float) -> tuple[list[tuple[float, float]], float]:
    """(reach, peak) of the triangles from the near end that have their resultant at ``arm`` from it, and the lone force
    at that end."""
    # A triangle's resultant is a third of its reach from its peak.
    place = 3 * arm / length * TRIANGLES
    below = min(int(place), TRIANGLES - 1)
    more = place - below
    pieces, lone = [], 0.0
    for n, share in ((below, 1 - more), (below + 1, more)):
        if share <= 0:
            continue
        if n == 0:
            lone = share * force
        else:
            reach = length * n / TRIANGLES
            pieces.append((reach, 2 * share * force / reach))
    return pieces, lone
