"""Curves of a Gmsh model as polylines: sampled to a chord tolerance, chained, closed into the outlines of zones."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..curves import Chords
from ..parts import Zone
from .model_drawing import GmshModelError


class Curves:
    """Curves of the current model as polylines, each with the tags of its end points."""

    def __init__(self, gmsh, chord: float) -> None:
        self.gmsh, self.chord = gmsh, chord
        self.known: dict = {}
        self.bent: dict[int, float] = {}  # largest distance of each curve that is not straight from its chords, m

    def chords(self) -> Chords:
        """Chords of all curves so far that are not straight."""
        return Chords.of([self.known[tag][0] for tag in self.bent], list(self.bent.values()))

    def polyline(self, tag: int) -> tuple[np.ndarray, int, int]:
        """(n, 2) points along the curve ``tag``, reversed for a negative one, and the tags of its end points."""
        if abs(tag) not in self.known:
            points, ends = self._sampled(abs(tag)), self.gmsh.model.getBoundary([(1, abs(tag))], False, True)
            first, last = (ends[0][1], ends[-1][1]) if ends else (-abs(tag), -abs(tag))
            if len(ends) == 2 and len(points) == 2:
                at = [self.gmsh.model.getValue(0, t, [])[:2] for t in (first, last)]
                points = np.array(at)
            self.known[abs(tag)] = points, abs(first) if ends else first, abs(last) if ends else last
        points, first, last = self.known[abs(tag)]
        return (points, first, last) if tag > 0 else (points[::-1], last, first)

    def _sampled(self, tag: int) -> np.ndarray:
        model = self.gmsh.model
        (low,), (high,) = model.getParametrizationBounds(1, tag)
        if model.getType(1, tag) == "Line":
            return model.getValue(1, tag, [low, high]).reshape(-1, 3)[:, :2]
        # Halve the pieces until the curve's midpoints are closer to the chords than the tolerance; a closed curve needs
        # a few pieces before its chords are meaningful.
        for pieces in (4, 8, 16, 32, 64, 128, 256, 512, 1024):
            t = np.linspace(low, high, 2 * pieces + 1)
            fine = model.getValue(1, tag, t.tolist()).reshape(-1, 3)[:, :2]
            points = fine[::2]
            away = float(np.hypot(*(fine[1::2] - 0.5 * (points[1:] + points[:-1])).T).max())
            if away <= self.chord:
                break
        if away > 1e-6 * self.chord:
            self.bent[tag] = max(self.chord, away)
        return points

    def chained(self, tags: list[int]) -> list[np.ndarray]:
        """Consecutive curves joined into polylines; a new one starts at branches."""
        pieces = [self.polyline(tag) for tag in tags]
        lines = []
        while pieces:
            points, first, last = pieces.pop(0)
            grown = True
            while grown:
                grown = False
                for end in (last, first):
                    meeting = [k for k, p in enumerate(pieces) if end in p[1:]]
                    if len(meeting) != 1 or first == last:
                        continue
                    other, a, b = pieces.pop(meeting[0])
                    if end == last:
                        other, b = (other, b) if a == end else (other[::-1], a)
                        points, last = np.concatenate([points, other[1:]]), b
                    else:
                        other, a = (other, a) if b == end else (other[::-1], b)
                        points, first = np.concatenate([other, points[1:]]), a
                    grown = True
                    break
            lines.append(points)
        return lines

    def zone(self, name: str, path: Path, surface: int, signed: list[int], edge_name: dict[int, str]) -> Zone:
        """Loops formed by the ``signed`` boundary curves of ``surface``, the widest one first."""
        waiting = list(signed)
        loops = []
        while waiting:
            tag = waiting.pop(0)
            points, first, last = self.polyline(tag)
            loop, label = [points[:-1]], [edge_name.get(abs(tag), "")] * (len(points) - 1)
            while last != first:
                following = next((t for t in waiting if self.polyline(t)[1] == last), None)
                if following is None:
                    # A curve listed against the loop's direction.
                    following = next((t for t in waiting if self.polyline(t)[2] == last), None)
                    if following is None:
                        raise GmshModelError(
                            f"{path.name}: the outline of surface {surface}, zone {name!r}, is not closed after curve "
                            f"{abs(tag)}",
                            "close its Curve Loop",
                        )
                    waiting.remove(following)
                    points, _, last = self.polyline(-following)
                else:
                    waiting.remove(following)
                    points, _, last = self.polyline(following)
                loop.append(points[:-1])
                label += [edge_name.get(abs(following), "")] * (len(points) - 1)
            loops.append((np.concatenate(loop), tuple(label)))
        loops.sort(key=lambda pair: -np.prod(np.ptp(pair[0], axis=0)))
        return Zone(name, tuple(pair[0] for pair in loops), tuple(pair[1] for pair in loops))
