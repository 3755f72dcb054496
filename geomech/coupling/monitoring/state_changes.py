"""Changes of state of block contacts and crack faces in a pass, and the events they make.

Of the contacts between two blocks, and of the nodes of a crack's faces, the first to slip (``slip``) and the last
(``sliding``: only friction is left) are reported, likewise for opening (``opening``, ``parting``); of closing and
renewed sticking only the first. Every contact that opens or closes is reported, and every lost bond. Faces of growing
cracks are identified by their earlier segments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model import OPEN, SLIP, STICK
from ..coupled_state import CrackedBlocks
from ..load_pass import Balance

#: Distance, as a fraction of their tributary length, below which a contact that opens and one that closes between the
#: same blocks are the same: the edge of either block may support a corner.
_SAME_PLACE = 0.02

_DOES = {
    "opening": "opens", "parting": "is apart", "closure": "closes", "slip": "begins to slip", "sliding": "slides",
    "stick": "sticks",
    "debonding": "loses bonds",
}  # fmt: skip
#: … and the states that contacts or nodes take.
_TAKES = {
    "opening": (OPEN,), "parting": (OPEN,), "closure": (STICK, SLIP), "slip": (SLIP,), "sliding": (SLIP,),
    "stick": (STICK,),
}  # fmt: skip


@dataclass(frozen=True)
class Change:
    """A change of state: ``kind`` of event; ``rows``: contacts or nodes (numbers after the change) that changed,
    ``contacts`` which of the two; ``last``: they were the last to change; place (m) and text."""

    kind: str
    contacts: bool
    rows: np.ndarray
    last: bool
    point: tuple[float, float]
    detail: str


@dataclass(frozen=True, eq=False)
class Watched:
    """The states of a pass that ended at ``time`` s.

    Contacts, one row for each corner and the block it touches, sorted by ``key`` (n,): ``state``, ``bonded``,
    ``reserve`` N/m (`dda.StepResult`), ``point`` (n, 2), ``pair`` (n, 2) of blocks, ``length`` (n,) m; ``numbering`` of
    the blocks and vertices. Nodes of crack faces: ``face_state`` and ``face_reserve`` Pa (`ddm.Solution`),
    ``face_point`` (m, 2), ``segment`` (m, 4) end points of their segment, ``crack`` (m,).
    """

    time: float
    numbering: tuple[int, int]
    key: np.ndarray
    state: np.ndarray
    bonded: np.ndarray
    reserve: np.ndarray
    point: np.ndarray
    pair: np.ndarray
    length: np.ndarray
    face_state: np.ndarray
    face_reserve: np.ndarray
    face_point: np.ndarray
    segment: np.ndarray
    crack: np.ndarray

    @classmethod
    def of(cls, now: CrackedBlocks, found: Balance, kinds: tuple[str, ...]) -> Watched:
        """States in the pass ``found``, of the ``kinds`` "contacts" and "faces"."""
        rows, reserve = found.result.contacts, found.result.reserve
        if "contacts" not in kinds:
            rows, reserve = rows[:0], reserve[:0]
        key = rows["vertex"] * now.blocks.n_blocks + rows["other"]
        # Of the edges of a block that a corner may touch, the closed one.
        order = np.lexsort((rows["state"] == OPEN, key))
        order = order[np.unique(key[order], return_index=True)[1]]
        rows = rows[order]
        solutions = found.solutions if "faces" in kinds else {}
        return cls(
            found.result.state.time, (now.blocks.n_blocks, len(now.blocks.vertices)), key[order], rows["state"],
            rows["bonded"], reserve[order], rows["point"], np.column_stack([rows["block"], rows["other"]]),
            rows["length"], *_faces(now, solutions),
        )  # fmt: skip

    def same_faces(self, other: Watched) -> bool:
        """Whether ``other`` has the same nodes on crack faces."""
        return np.array_equal(self.face_point, other.face_point)

    def changes(self, now: CrackedBlocks, before: Watched) -> list[Change]:
        """Changes since ``before``. Contacts are compared only between the same blocks."""
        changes = self._of_contacts(now, before) if self.numbering == before.numbering else []
        return changes + self._of_faces(now, before)

    def _of_contacts(self, now: CrackedBlocks, before: Watched) -> list[Change]:
        rows, known = _found(self.key, before.key)
        was, had = np.full(len(self.key), OPEN), np.zeros(len(self.key), int)
        was[known], had[known] = before.state[rows], before.bonded[rows]
        lost = (had > 0) & (self.bonded == 0)
        opens, closes = (was != OPEN) & (self.state == OPEN), (was == OPEN) & (self.state != OPEN)
        # A corner that is no longer near was open, or is now supported by the edge of the other block.
        gone = np.setdiff1d(np.flatnonzero(before.state != OPEN), rows)
        kept = ~self._taken_over(opens, closes, before, gone)
        changed = np.flatnonzero(((was != self.state) | lost) & kept)
        changes = []
        for a, b in sorted(set(map(tuple, np.sort(self.pair[changed], axis=1).tolist()))):
            of = (np.sort(self.pair, axis=1) == (a, b)).all(axis=1)
            each = {"opening": opens, "closure": closes, "debonding": lost}
            kinds = {kind: last for kind, last in _turns(was[of], self.state[of]) if kind not in each}
            kinds |= {kind: False for kind, which in each.items() if which[of].any()}
            rows_of = changed[of[changed]]
            for kind, last in kinds.items():
                own = rows_of[lost[rows_of] if kind == "debonding" else np.isin(self.state[rows_of], _TAKES[kind])]
                if len(own):
                    x, y = self.point[own].mean(axis=0).tolist()
                    detail = f"{now.blocks.names[b]} on {now.blocks.names[a]} {_DOES[kind]}"
                    changes.append(Change(kind, True, own, last, (x, y), detail))
        return changes

    def _taken_over(self, opens: np.ndarray, closes: np.ndarray, before: Watched, gone: np.ndarray) -> np.ndarray:
        """(n,) bool: contacts that open or close next to one of the same blocks that does the opposite."""
        out = np.zeros(len(opens), bool)
        opens, closes = np.flatnonzero(opens), np.flatnonzero(closes)
        if not len(closes) or not len(opens) + len(gone):
            return out
        left = np.concatenate([self.point[opens], before.point[gone]])
        pair = np.sort(np.concatenate([self.pair[opens], before.pair[gone]]), axis=1)
        for c in closes.tolist():
            same = (pair == np.sort(self.pair[c])).all(axis=1)
            near = same & (np.hypot(*(left - self.point[c]).T) < _SAME_PLACE * self.length[c])
            if near.any():
                out[c] = True
                out[opens[near[: len(opens)]]] = True
        return out

    def _of_faces(self, now: CrackedBlocks, before: Watched) -> list[Change]:
        if not len(self.face_state) or not len(before.face_state):
            return []
        if self.same_faces(before):
            known_rows = known_before = np.ones(len(self.crack), bool)
            changed = self.face_state != before.face_state
        else:
            known_rows, known_before = _of_both(self.segment, before.segment)
            changed = known_rows
        changes = []
        for c in np.unique(self.crack[changed]).tolist():
            here, then = known_rows & (self.crack == c), known_before & (before.crack == c)
            for kind, last in _turns(before.face_state[then], self.face_state[here]):
                rows = np.flatnonzero(here & changed & np.isin(self.face_state, _TAKES[kind]))
                if len(rows):
                    x, y = self.face_point[rows].mean(axis=0).tolist()
                    changes.append(Change(kind, False, rows, last, (x, y), f"{now.cracks.names[c]} {_DOES[kind]}"))
        return changes


def _faces(now: CrackedBlocks, solutions: dict) -> tuple[np.ndarray, ...]:
    """State, reserve, position, segment and crack of all nodes of faces that can touch."""
    state, reserve, point, segment, crack = [], [], [], [], []
    for block, solution in solutions.items():
        faces = solution.faces
        which = np.flatnonzero(now.cracks.block == block)[faces.segment]
        per = solution.states.shape[1]
        meets = np.repeat(np.isfinite(now.cracks.aperture[which]), per)
        state.append(solution.states.ravel()[meets])
        reserve.append(solution.reserve.ravel()[meets])
        point.append(faces.points[:, 1:-1].reshape(-1, 2)[meets])
        ends = now.cracks.nodes[now.cracks.segments[which]].reshape(-1, 4)
        segment.append(np.repeat(ends, per, axis=0)[meets])
        crack.append(np.repeat(now.cracks.crack[which], per)[meets])
    if not state:
        return np.zeros(0, int), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 4)), np.zeros(0, int)
    return tuple(np.concatenate(each) for each in (state, reserve, point, segment, crack))


def _found(key: np.ndarray, among: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the sorted ``among`` (m,) that match ``key`` (n,), and which of ``key`` match (n,) bool."""
    at = np.searchsorted(among, key)
    known = at < len(among)
    known[known] = among[at[known]] == key[known]
    return at[known], known


def _of_both(segment: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of the segments (n, 4) and (m, 4) are in both: (n,), (m,) bool."""
    names = [[row.tobytes() for row in np.ascontiguousarray(each)] for each in (segment, other)]
    own, others = (set(each) for each in names)
    return np.array([name in others for name in names[0]], bool), np.array([name in own for name in names[1]], bool)


def _turns(before: np.ndarray, after: np.ndarray) -> list[tuple[str, bool]]:
    """Kinds of events for the change of the states of a joint or crack from ``before`` (n,) to ``after`` (m,), and
    whether each is that of the last contact or node."""
    (o, t, s), (o2, t2, s2) = (np.bincount(each, minlength=3).tolist() for each in (before, after))
    closed, closed2 = t + s, t2 + s2
    turns = (
        ("opening", closed and o2 and not o, False),
        ("parting", closed and o2 and not closed2, True),
        ("closure", o and closed2 and not closed, False),
        ("slip", t and s2 and not s, False),
        ("sliding", t and s2 and not t2, True),
        ("stick", s and t2 and not t, False),
    )
    return [(kind, last) for kind, happens, last in turns if happens]
