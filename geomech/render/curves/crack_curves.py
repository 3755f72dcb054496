"""Curves of a run's cracks: stress intensity factors of the tips, and the length of all cracks."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geomech.output.reading import Run
from geomech.output.units import length_unit

from .drive import COLOURS, SAME, drive, drive_label, first_events, to_the_end

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Number of curves with a colour and name of their own, those of the tips with the largest growth or K; others are
#: grey.
NAMED = 6
#: Number of tips named where they share a curve.
SHARING = 2
#: With many tips, K of a runaway crack, or of a last ligament, is above this percentile.
MOST_TIPS = 98.0
_GREY = "#c4c6ca"


class TipCurve(NamedTuple):
    """``members`` (crack, end) share ``load`` (drive), ``k_i`` and ``k_ii`` (MPa√m); they grow by ``grown`` (m)."""

    members: list[tuple[int, int]]
    load: np.ndarray
    k_i: np.ndarray
    k_ii: np.ndarray
    grown: float


def stress_intensity(axes: Axes, run: Run) -> None:
    """K_I (full) and K_II (dashed) at every tip against load, or time without a leading load.

    Growth relieves a tip, the load drives it up again. Tips with equal curves share one; the toughness is a horizontal
    line.
    """
    curves = tip_curves(run)
    n_tips = sum(len(curve.members) for curve in curves)
    named = _foremost(curves)
    others = [curve for k, curve in enumerate(curves) if k not in named]
    for curve in others:
        axes.plot(curve.load, curve.k_i, color=_GREY, lw=0.8)
        axes.plot(curve.load, curve.k_ii, color=_GREY, lw=0.8, ls="--")
    for colour, k in zip(COLOURS, named):
        curve = curves[k]
        axes.plot(curve.load, curve.k_i, color=colour, lw=1.4, label=_tip_names(run, curve.members, n_tips))
        axes.plot(curve.load, curve.k_ii, color=colour, lw=1.0, ls="--")
    if others:
        count = sum(len(curve.members) for curve in others)
        axes.plot([], [], color=_GREY, lw=0.8, label=f"{count} more tip{'s' if count > 1 else ''}")
    axes.plot([], [], color="#555555", lw=1.6, label=r"$K_I$")
    axes.plot([], [], color="#555555", lw=1.3, ls="--", label=r"$K_{II}$")
    axes.axhline(0, color="#999999", lw=0.6)
    toughness = run.summary.get("normalisation", {}).get("k_ic_pa_sqrt_m")
    if toughness:
        axes.axhline(toughness / 1e6, color="#222222", lw=0.9, ls=":", label=r"$K_{Ic}$")
    # With many curves none of the corners is free.
    placement = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)} if others else {}
    axes.legend(frameon=False, fontsize=8, **placement)
    low, high = _calm_span(run)
    title = run.title
    if high > low:
        # A runaway crack would make all others flat, so it is cut off at the top instead.
        room = 2.0 * max((toughness or 0.0) / 1e6, high, -low)
        bottom, top = axes.get_ylim()
        axes.set_ylim(max(bottom, low - room), min(top, high + room))
        highest = max((float(np.nanmax(np.abs([c.k_i, c.k_ii]), initial=0.0)) for c in curves), default=0.0)
        if highest > max(high + room, room - low):
            axes.text(
                0.01, 0.99, f"above the range: up to {highest:.3g}", transform=axes.transAxes, fontsize=7, va="top"
            )
    axes.set(xlabel=drive_label(run), ylabel="stress intensity factor, MPa√m", title=title)


def _foremost(curves: list[TipCurve]) -> list[int]:
    """The named curves, in order: all if they are few, else those with the largest growth, then K."""
    if len(curves) <= NAMED:
        return list(range(len(curves)))
    sizes = [float(np.nanpercentile(np.abs(np.concatenate([c.k_i, c.k_ii])), 90)) for c in curves]
    order = sorted(range(len(curves)), key=lambda k: (-curves[k].grown, -sizes[k]))
    return sorted(order[:NAMED])


def _calm_span(run: Run) -> tuple[float, float]:
    """Least and largest K_I or K_II, MPa√m, right after load increments; of many tips, the percentile `MOST_TIPS`."""
    converged_cycles = run.history["cycle"][run.history["growth_pass"] == 0]
    tips = run.tips[np.isin(run.tips["cycle"], converged_cycles)]
    every = np.concatenate([tips["K_I"], tips["K_II"]]) / 1e6
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.0, 0.0
    beyond = 100.0 - MOST_TIPS if len(np.unique(tips["crack"])) > NAMED else 0.0
    low, high = np.percentile(every, [beyond, 100.0 - beyond])
    return min(0.0, float(low)), max(0.0, float(high))


def tip_curves(run: Run) -> list[TipCurve]:
    """One curve for every tip; tips with coinciding curves share one."""
    tips = run.tips
    every = np.abs([tips["K_I"], tips["K_II"]])
    every = every[np.isfinite(every)]
    # Of many tips, a runaway one is not the scale for the others.
    many = len(np.unique(tips["crack"])) > NAMED
    near = SAME * float(np.percentile(every, 90.0 if many else 100.0)) if len(every) else 0.0
    groups: list[tuple[list[tuple[int, int]], np.ndarray]] = []
    for crack, end in np.unique(np.stack([tips["crack"], tips["end"]], axis=1), axis=0).astype(int):
        own = tips[(tips["crack"] == crack) & (tips["end"] == end)]
        for members, known in groups:
            if np.array_equal(known["cycle"], own["cycle"]) and all(
                np.abs(known[name] - own[name]).max() <= near for name in ("K_I", "K_II")
            ):
                members.append((crack, end))
                break
        else:
            groups.append(([(crack, end)], own))
    return [
        TipCurve(members, drive(run, own), own["K_I"] / 1e6, own["K_II"] / 1e6, float(np.nansum(own["grown_m"])))
        for members, own in groups
    ]


def _tip_names(run: Run, members: list[tuple[int, int]], n_tips: int) -> str:
    if len(members) == n_tips and n_tips > 2:
        return f"all {n_tips} tips"
    names = run.summary.get("cracks", [])
    parts = []
    for crack in dict.fromkeys(crack for crack, _ in members):
        ends = [end for other, end in members if other == crack]
        name = names[crack] if crack < len(names) else f"crack {crack}"
        parts.append((f"{name}, {'both tips' if len(ends) > 1 else ('start', 'end')[ends[0]]}", len(ends)))
    more = sum(count for _, count in parts[SHARING:])
    return "; ".join(description for description, _ in parts[:SHARING]) + (f"; {more} tips like them" if more else "")


def crack_length(axes: Axes, run: Run) -> None:
    """Length of all cracks against load, or time without a leading load; growth at one load is a vertical line.

    Where rock breaks apart its cracks become block faces: they are still counted, and the remaining cracks are dashed.
    """
    history, every = to_the_end(run), length_ever(run)
    unit, size = length_unit(float(every.max()))
    at, still = drive(run, history), history["crack_length"]
    parted = bool((every - still > 1e-6 * every.max()).any())
    everything = "including those that are now block faces" if parted else None
    axes.plot(at, every / size, color=COLOURS[0], lw=1.8, label=everything)
    if parted:
        axes.plot(at, still / size, color=COLOURS[0], lw=1.2, ls="--", label="cracks still")
    first_events(axes, run, None)
    if parted:
        axes.legend(frameon=False, fontsize=8)
    axes.set(xlabel=drive_label(run), ylabel=f"crack length, {unit}", title=run.title)


def length_ever(run: Run) -> np.ndarray:
    """(rows to the end,) m: length of all cracks, including those that have become block faces.

    Between two cycles the length grows by the growth of the tips, and is reduced only by cracks that become block
    faces.
    """
    history = to_the_end(run)
    length = history["crack_length"]
    grown = np.zeros(len(history))
    row = np.minimum(np.searchsorted(history["cycle"], run.tips["cycle"]), len(history) - 1)
    own = np.isfinite(run.tips["grown_m"]) & (run.tips["cycle"] <= history["cycle"][-1])
    np.add.at(grown, row[own], run.tips["grown_m"][own])
    change = np.diff(length)
    return length[0] + np.concatenate([[0.0], np.cumsum(np.where(change < -1e-12, grown[:-1], change))])
