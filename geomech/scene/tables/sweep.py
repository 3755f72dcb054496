"""Many runs of a scene: [sweep], or a sweep.toml next to the scene."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict

from .entries import Names, NotNegative, Positive, Table


class CorrelationTable(Table):
    """Two correlated random variables."""

    between: Annotated[tuple[str, str], Strict(False)] = Field(description="names of two random variables")
    coefficient: Annotated[float, Field(gt=-1, lt=1)] = Field(
        description="correlation coefficient of the underlying normal variables (Gaussian copula)"
    )


class SweepTable(Table):
    """[sweep]."""

    vary: dict[str, Any] = Field(
        {},
        description='variables: "section.key" = "20:40:5" (a range), "log(1e3, 1e6, 4)", [20, 30] (values), '
        '"normal(35, 5)" or another distribution; names without a dot are for `derive`',
    )
    derive: dict[str, Any] = Field(
        {}, description='dependent keys of the scene: "section.key" = an expression of the variables'
    )
    correlated: Annotated[tuple[CorrelationTable, ...], Strict(False)] = Field(
        (), description="correlated random variables"
    )
    seeds: str | Annotated[tuple[int, ...], Strict(False)] | None = Field(
        None, description='joint seeds, such as "0-499": one run each (unset: the scene\'s own)'
    )
    runs: Annotated[int, Field(ge=1)] | None = Field(
        None, description="number of samples of the random variables (unset: as many as seeds)"
    )
    sampling: Literal["monte carlo", "latin hypercube", "sobol", "saltelli"] = Field(
        "monte carlo", description='sampling method; "saltelli" gives Sobol\' sensitivities'
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the samples: the same seed, the same table")
    measure: Literal["safety", "run", "pause"] = Field(
        "safety", description='computation for every scene: "safety" (factor of safety), "run" (a run to its end)'
    )
    fails: str | None = Field(
        None,
        description='when a slope counts as failed, an expression of columns (unset: "factor_of_safety < 1", of runs '
        '"moving_blocks > 0")',
    )
    columns: dict[str, str] = Field(
        {}, description="further columns by name, expressions of other columns and of the summary"
    )
    along: Names | None = Field(None, description='for "safety": the joints to be weakened (unset: all)')
    divide: dict[str, Positive] = Field({}, description='for "safety": partial factors, such as { cohesion = 1.25 }')
    tolerance: Positive = Field(2e-3, description='for "safety": relative width of the bracket')
    at_s: NotNegative | None = Field(
        None, description=('for "safety": time at which the loads are taken, s (unset: the scene\'s end)')
    )
    without_cracks: bool = Field(False, description='for "safety": leave out cracks inside blocks')
    moved_share: Positive = Field(
        0.01, description='for "run": a block that has moved by more than this part of its size √area counts as moving'
    )
    pause_s: NotNegative = Field(0.01, description='for "pause", used by benchmarks: waiting time of a run, s')
    keep: Literal["none", "failed", "all"] = Field(
        "none",
        description="run folders to keep: none, those of failed slopes and of runs with an error, or all",
    )
    rare: Literal["subset", "importance"] | None = Field(
        None, description="method for probabilities below 1e-2: subset simulation, importance sampling (unset: plain)"
    )
