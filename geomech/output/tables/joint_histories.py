"""CSV files of joints and supports: ``joints.csv``, one row per joint and cycle, and ``reactions.csv``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from geomech.model import Cycle, Problem
from geomech.model.joints.joint_sums import JOINT_SUM, joint_sums, reactions

from ..fields import JOINTS, REACTIONS
from .histories import Table, TableEnd


class JointHistories:
    """Observer that sums up contacts by joint (`geomech.model.joints.joint_sums`) and their forces on fixed and guided
    blocks."""

    def on_start(self, problem: Problem, folder: Path) -> None:
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._laws = problem.joints
        self._joints, self._reactions = Table(folder / "joints.csv", JOINTS), Table(folder / "reactions.csv", REACTIONS)

    def memory(self) -> list[TableEnd]:
        return [self._joints.end, self._reactions.end]

    def on_resume(self, problem: Problem, folder: Path, memory: list[TableEnd]) -> None:
        self._laws = problem.joints
        self._joints, self._reactions = (
            Table.cut_back(Path(folder) / name, end)
            for name, end in zip(("joints.csv", "reactions.csv"), memory, strict=True)
        )

    def on_cycle(self, cycle: Cycle) -> None:
        contacts, same = cycle.state.contacts, {"cycle": cycle.number, "time": cycle.state.time}
        sums = joint_sums(cycle.blocks, contacts, self._laws)
        self._joints.add(
            same | {"joint": name} | dict(zip(JOINT_SUM.names or (), row.tolist(), strict=True))
            for name, row in sums.items()
        )
        self._reactions.add(
            same | {"block": cycle.blocks.names[block], "force_x": fx, "force_y": fy, "moment": moment}
            for block, (fx, fy, moment) in reactions(cycle.blocks, contacts).items()
        )

    def on_end(self, summary: dict[str, Any], error: BaseException | None = None) -> None:
        self._joints.close()
        self._reactions.close()
