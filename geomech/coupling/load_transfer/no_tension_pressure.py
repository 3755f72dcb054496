"""The pressure on a joint face that has the force and moment of its contacts and pulls nowhere.

A resultant in the middle third is the linear pressure on the whole length. Nearer to an end it would pull at the other
one; it is then what a no-tension face does, a triangle on a shorter length, as a mixture of two triangles of fixed
lengths, so that a body meets the same few loads again and again. At the very end all of it is a lone force, as it is
when the contact there is the only one that is left: the pressure goes over into it without a jump, which would leave
blocks and cracks no state to settle in.
"""

from __future__ import annotations

from ...compiled import kept
from .piecewise_traction import jit

#: Triangles are on 1/n, 2/n … of a face's length.
TRIANGLES = 8

#: A piece without length.
NOTHING = (0.0, 0.0, 0.0, 0.0)


@kept(error_model="numpy", nogil=True)
def no_pull(length, force, moment):
    """Two pieces (start, end, p_start, p_end) of a pressure on [0, length], linear on each (they add up; one may have no
    length), and lone forces at its start and at its end, all together with resultant ``force`` and ``moment`` about 0.

    None of it is negative where the force is positive and its line of action meets the face; a resultant outside cannot
    be carried without pull and stays linear, pull and all, since force and moment come first.
    """
    arm = moment / force if force > 0 else -1.0
    if 0 <= arm < length / 3:
        near, peak, far, high, lone = _near_end(length, force, arm)
        return ((0.0, near, peak, 0.0), (0.0, far, high, 0.0)), lone, 0.0
    if 0 <= length - arm < length / 3:
        near, peak, far, high, lone = _near_end(length, force, length - arm)
        return ((length - near, length, 0.0, peak), (length - far, length, 0.0, high)), 0.0, lone
    return (linear(length, force, moment), NOTHING), 0.0, 0.0


@jit
def linear(length, force, moment):
    """The pressure linear on [0, length] with resultant ``force`` and ``moment`` about 0."""
    return 0.0, length, (4 * force * length - 6 * moment) / length**2, (6 * moment - 2 * force * length) / length**2


@jit
def _near_end(length, force, arm):
    """Reach and peak of the two triangles from the near end that have their resultant at ``arm`` from it, and the lone
    force at that end."""
    # A triangle's resultant is a third of its reach from its peak.
    place = 3 * arm / length * TRIANGLES
    below = min(int(place), TRIANGLES - 1)
    more = place - below
    near, far = length * below / TRIANGLES, length * (below + 1) / TRIANGLES
    high = 2 * more * force / far
    if below == 0:
        return 0.0, 0.0, far, high, (1 - more) * force
    return near, 2 * (1 - more) * force / near, far, high, 0.0
