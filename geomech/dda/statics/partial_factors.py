"""Partial factors applied to strength before the search for a factor of safety, and the choice of joints to reduce.

Design codes divide cohesion, tan φ and tensile strength by separate partial factors (EN 1997-1, 2.4.6.2): c/γ_c, tan
φ/γ_φ, σₜ/γ_t. The factor of safety is then additional, and the design is verified if it is at least 1. To reduce the
strength of selected joints only, their faces get joint laws of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

from ...model import JointLaw, Problem
from .strength_reduction import NothingToReduce

#: Prefix of the edge names along drawn joints.
_DRAWN = "joint:"


@dataclass(frozen=True)
class PartialFactors:
    """Divisors of ``cohesion``, ``friction`` (tan φ) and tensile strength (``tension``), residual values included.
    Raises `NothingToReduce` unless they are positive numbers."""

    cohesion: float = 1.0
    friction: float = 1.0
    tension: float = 1.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
                raise NothingToReduce(f"the partial factor on {each.name} must be a positive number, got {value!r}")

    @classmethod
    def of(cls, given: Mapping[str, float] | Iterable[str] | PartialFactors | None) -> PartialFactors:
        """From a mapping, or from texts such as "cohesion=1.25". Raises `NothingToReduce` naming the fault."""
        if given is None or isinstance(given, PartialFactors):
            return given or cls()
        if not isinstance(given, Mapping):
            given = _read([given] if isinstance(given, str) else given)
        names = [each.name for each in fields(cls)]
        for name in given:
            if name not in names:
                raise NothingToReduce(f"no strength {name!r} to divide; there are {', '.join(names)}")
        return cls(**given)

    @property
    def plain(self) -> bool:
        """Whether all factors are 1."""
        return self == PartialFactors()

    def design(self, law: JointLaw) -> JointLaw:
        """``law`` with its strengths divided; an angle of dilation is kept as long as it is below that of friction."""
        if law.roughness is not None:
            return replace(
                law, roughness=replace(law.roughness, reduction=law.roughness.reduction * self.friction)
            )  # fmt: skip

        def angle(of: float) -> float:
            return math.atan(math.tan(of) / self.friction)

        friction, residual = angle(law.friction_angle), law.residual_friction_angle
        return replace(
            law, friction_angle=friction, residual_friction_angle=None if residual is None else angle(residual),
            cohesion=law.cohesion / self.cohesion, residual_cohesion=law.residual_cohesion / self.cohesion,
            tensile_strength=law.tensile_strength / self.tension, dilation_angle=min(law.dilation_angle, friction),
        )  # fmt: skip

    def __str__(self) -> str:
        return f"cohesion by {self.cohesion:g}, tan φ by {self.friction:g}, tensile strength by {self.tension:g}"


def _read(words: Iterable[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for word in words:
        name, sign, value = word.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not sign or math.isnan(number):
            raise NothingToReduce(f"a partial factor is given as cohesion=1.25, not {word!r}")
        if name in found:
            raise NothingToReduce(f"the partial factor on {name} is given twice")
        found[name] = number
    return found


def design_problem(
    problem: Problem, divide: PartialFactors, along: Sequence[str] | None = None
) -> tuple[Problem, list[str] | None]:
    """``problem`` with design strengths, and the names of its laws that are to be reduced (None: all of them).

    ``along`` names joint laws, or joints as they were drawn ("bedding" or "joint:bedding"); faces of the latter get
    laws of their own, called "LAW along JOINT". Raises `NothingToReduce` for a name that is neither.
    """
    laws = [divide.design(law) for law in problem.joints]
    problem = replace(problem, joints=tuple(laws))
    if along is None:
        return problem, None
    known = {law.name for law in laws}
    drawn = {name.removeprefix(_DRAWN): name for name in problem.blocks.edge_names if name.startswith(_DRAWN)}
    chosen: list[str] = []
    edges: set[str] = set()
    for name in dict.fromkeys(along):
        edge = drawn.get(name.removeprefix(_DRAWN))
        if name in known:
            chosen.append(name)
        elif edge is not None:
            edges.add(edge)
        else:
            raise NothingToReduce(
                f"no joint {name!r} to reduce; there are the joint laws {', '.join(map(repr, sorted(known)))}"
                + (f", and the joints drawn as {', '.join(map(repr, sorted(drawn)))}" if drawn else "")
            )
    for edge in sorted(edges):
        problem, new = _with_own_laws(problem, edge)
        chosen += new
    return problem, chosen


def _with_own_laws(problem: Problem, edge: str) -> tuple[Problem, list[str]]:
    """The problem with separate laws for the faces whose edges are called ``edge``, and the names of these laws."""
    laws, joint_of, new = list(problem.joints), dict(problem.joint_of), {}
    for other in problem.blocks.edge_names:
        law = problem.joint_index(edge, other)
        if law not in new:
            new[law] = len(laws)
            name = f"{problem.joints[law].name} along {edge.removeprefix(_DRAWN)}"
            laws.append(replace(problem.joints[law], name=name))
        first, second = sorted((edge, other))
        joint_of[(first, second)] = new[law]
    return replace(problem, joints=tuple(laws), joint_of=joint_of), [laws[k].name for k in new.values()]
