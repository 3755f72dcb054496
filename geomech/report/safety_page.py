"""Report of a factor of safety: factor and bracket, mechanism, mobilised strength of joints, forces of anchors and
toes, and the limits of the search."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..dda.statics.displacement_limit import MOVED
from ..dda.statics.mobilised_strength import MobilisedJoint, mobilised_joints
from ..dda.statics.partial_factors import PartialFactors
from ..dda.statics.safety_answer import FactorOfSafety
from ..dda.statics.sharp_toes import place
from ..model import OPEN, SLIP, Problem, counted

#: A block slides if it rotates by less than the first value (rad) while it moves by its own size √area; it topples if
#: it rotates by more than the second about a point within two of its sizes; in between it does both.
SLIDES, TOPPLES = 0.05, 0.5
#: Number of blocks and joints in the text; files list all of them.
_LISTED = 8


@dataclass(frozen=True)
class MovingBlock:
    """Motion of a block at failure.

    part           displacement relative to the farthest block's
    towards        direction, degrees from +x counter-clockwise
    turn           rotation, rad (positive counter-clockwise), while it moves by its own size
    kind           "slides", "topples" or "slides and topples"
    displacement   (x, y), relative to the farthest block's
    travel         m that it goes when it has failed; None if that was not followed
    """

    name: str
    part: float
    towards: float
    turn: float
    kind: str
    displacement: tuple[float, float]
    travel: float | None = None

    def __str__(self) -> str:
        text = f"{self.name}: {self.part:.2f} of the fastest, towards {round(self.towards) + 0}°: {self.kind}"
        if abs(self.turn) > SLIDES:
            side = "left" if self.turn > 0 else "right"
            text += f", turning {side} by {math.degrees(abs(self.turn)):.0f}° while it moves by its own size (√area)"
        return text if self.travel is None else f"{text}; travels {self.travel:.3g} m"


@dataclass(frozen=True, eq=False)
class SafetyReport:
    """Report of a factor ``found`` for ``problem`` (with design strengths, see `design_problem`).

    reduced      names of the laws whose strength was reduced; None: all
    divide       partial factors applied to strengths first
    along        the joints as requested; None: all
    cracks       names of cracks that were left out
    tolerance    requested relative width of the bracket
    """

    problem: Problem
    found: FactorOfSafety
    reduced: list[str] | None = None
    divide: PartialFactors = field(default_factory=PartialFactors)
    along: list[str] | None = None
    cracks: tuple[str, ...] = ()
    tolerance: float = 2e-3

    def moving(self) -> list[MovingBlock]:
        """Blocks that move at failure, the fastest first."""
        failed = min((t for t in self.found.trials if not t.stable), key=lambda t: t.factor, default=None)
        if failed is None or not self.found.moving:
            return []
        blocks, out = self.problem.blocks, []
        size = np.sqrt(np.abs(blocks.areas()))
        far = float(np.hypot(*failed.displacement[self.found.moving[0]]))
        for b in self.found.moving:
            x, y = (failed.displacement[b] / far).tolist()
            own = math.hypot(x, y)
            turn = float(failed.rotation[b]) * float(size[b]) / (own * far)
            kind = "slides" if abs(turn) < SLIDES else "topples" if abs(turn) > TOPPLES else "slides and topples"
            goes = None if self.found.travel is None else float(self.found.travel.moved[b])
            out.append(MovingBlock(blocks.names[b], own, math.degrees(math.atan2(y, x)), turn, kind, (x, y), goes))
        return out

    @property
    def mechanism(self) -> str:
        """One of "sliding", "toppling", "sliding and toppling"; empty if nothing fails."""
        kinds = Counter(each.kind for each in self.moving())
        words = {"sliding": "slides", "toppling": "topples"}
        return " and ".join(word for word, kind in words.items() if any(kind in each for each in kinds))

    def joints(self) -> list[MobilisedJoint]:
        """Joints in the equilibrium at ``found.lower``."""
        return mobilised_joints(
            self.problem.blocks, self.problem.joints, self.found.state, self.found.lower, self.reduced
        )

    def sliding_faces(self) -> np.ndarray:
        """(n, 2, 2) m: faces between two blocks that have mobilised all their strength."""
        rows = self.found.state.contacts
        rows = rows[rows["length"] > 0]
        pairs = np.sort(np.stack([rows["block"], rows["other"]], axis=1), axis=1)
        out = []
        for pair in np.unique(pairs[rows["state"] == SLIP], axis=0):
            own = rows[(pairs == pair).all(axis=1)]
            own = own[own["state"] != OPEN]
            if len(own) > 1 and (own["state"] == SLIP).all():
                along = own["point"] @ np.array([-own["normal"][0, 1], own["normal"][0, 0]])
                out.append(own["point"][[np.argmin(along), np.argmax(along)]])
        return np.array(out).reshape(-1, 2, 2)

    def strain(self) -> tuple[float, str]:
        """Largest elastic strain of a block at ``found.lower``, and the block."""
        problem, state = self.problem, self.found.state
        free = np.flatnonzero(~problem.blocks.fixed)
        modulus = np.array([m.plane_modulus for m in problem.materials])[problem.blocks.material[free]]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.nan_to_num(np.abs(state.stress[free]).max(axis=1) / modulus)
        worst = int(np.argmax(share))
        return float(share[worst]), problem.blocks.names[free[worst]]

    def text(self, title: str = "factor of safety") -> str:
        """Report for the terminal."""
        found, names = self.found, self.problem.blocks.names
        if math.isfinite(found.upper):
            lines = [f"{title} {found.factor:.4f} (equilibrium at {found.lower:.4f}, none at {found.upper:.4f})"]
        else:
            lines = [f"{title} above {found.lower:g}: the search ends there"]
        if not self.divide.plain:
            enough = "suffices" if found.lower >= 1 or found.factor >= 1 else "does not suffice"
            lines.append(f"  in addition to partial factors: {self.divide}; the design strength {enough}")
        if self.along is not None:
            lines.append(f"  reduced along {', '.join(self.along)} only")
        moving = self.moving()
        if moving:
            lines.append(f"mechanism: {self.mechanism}; blocks that move at failure:")
            lines += [f"  {each}" for each in moving[:_LISTED]] + _more(len(moving), f"of {len(names)} blocks")
            lines += [f"  {found.travel_text()}"] if found.travel is not None else []
        lines += self._joint_lines()
        if found.anchors:
            lines.append("anchors at the factor:")
            lines += [
                f"  bolt {a.name}: {a.force / 1e3:.4g} kN/m, {'at' if a.yields else 'not at'} its yield force, "
                f"stretched by {1e3 * a.stretch:.3g} mm; its block has moved {1e3 * a.moved:.3g} mm"
                for a in found.anchors
            ]
        if found.toes:
            other = (
                ""
                if found.other_factor is None
                else (
                    f"; {'without them' if found.toes_hold else 'with sharp tips'} the factor is {found.other_factor:.4f}"
                )
            )
            lines.append(f"toes that {'hold' if found.toes_hold else 'touch when rounded, and do not hold'}{other}:")
            lines += [
                f"  of {names[t.block]} on {names[t.other]} at {place(*t.at)}"
                + (f": {t.force / 1e3:.4g} kN/m" if found.toes_hold else "")
                for t in found.toes
            ]
        lines += [self._search_line(), *(f"warning: {line}" for line in found.warnings)]
        return "\n".join(lines)

    def _joint_lines(self) -> list[str]:
        joints = self.joints()
        if not joints:
            return []
        lines = [
            "joints at the factor, their strength divided by it:",
            f"  {'joint':24}{'length m':>9}{'normal kN/m':>13}{'shear kN/m':>12}{'strength':>11}{'mobilised':>11}"
            f"{'slides':>8}{'open':>8}",
        ]
        for each in joints[:_LISTED]:
            name = each.joint.removeprefix("joint:") or each.law
            name += "" if name == each.law or each.law.endswith(name) else f" ({each.law})"
            name += "" if each.reduced else ", whole"
            lines.append(
                f"  {name:24}{each.length:9.4g}{each.normal / 1e3:13.4g}{each.shear / 1e3:12.4g}"
                f"{each.strength / 1e3:11.4g}{each.share:11.0%}{each.slides:8.0%}{each.parted:8.0%}"
            )
        return lines + _more(len(joints), f"of {counted(len(joints), 'joint')}")

    def _search_line(self) -> str:
        found, blocks = self.found, self.problem.blocks
        strain, strained = self.strain()
        free = np.flatnonzero(~blocks.fixed)
        far = free[int(np.argmax(found.moved[free]))]
        cracks = f"{counted(len(self.cracks), 'crack')} left out, " if self.cracks else ""
        return (
            f"search: {cracks}{len(found.trials)} trials; at the factor blocks have moved by "
            f"{1e3 * found.moved[far]:.3g} mm at most ({blocks.names[far]}) and are strained by {strain:.2g} ({strained}); a block that moves by more than "
            f"{MOVED:g} of its size (√area) beyond what elasticity explains has failed"
        )

    def draw(self, path: Path, title: str = "factor of safety") -> Path:
        """The picture of the mechanism."""
        from ..render.pictures.mechanism import draw_mechanism

        found = self.found
        factor = f"{found.factor:.3f}" if math.isfinite(found.upper) else f"above {found.lower:g}"
        return draw_mechanism(
            self.problem, f"{self.problem.title}: {title} {factor}, {self.mechanism or 'nothing fails'}",
            self.moving(), self.sliding_faces(), [toe.at for toe in found.toes],
            {anchor.name: anchor.force for anchor in found.anchors}, path,
        )  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for a file."""
        found = self.found
        strain, strained = self.strain()
        moving = {m.name: m for m in self.moving()}
        out: dict[str, Any] = found.as_dict(self.problem.blocks)
        for name, entry in out["moving"].items():
            entry["kind"], entry["towards_deg"] = moving[name].kind, moving[name].towards
        return out | {
            "mechanism": self.mechanism,
            "joints": [
                {**vars(each), "mobilised": each.share} for each in self.joints()
            ],
            "partial_factors": vars(self.divide),
            "along": self.along,
            "search": {
                "tolerance": self.tolerance, "cracks_left_out": list(self.cracks), "largest_strain": strain,
                "most_strained": strained,
                "largest_displacement_m": float(found.moved[~self.problem.blocks.fixed].max()),
                "displacement_limit_of_size": MOVED,
            },
        }  # fmt: skip


def _more(number: int, of: str) -> list[str]:
    return [f"  and {number - _LISTED} more {of}"] if number > _LISTED else []
