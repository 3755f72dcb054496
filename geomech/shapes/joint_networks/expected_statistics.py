"""Expected statistics of a joint set from its distributions, i.e. the mean over many networks.

Each is a dictionary: ``p10_per_m`` across the set, ``p20_per_m2``, ``p21_per_m``, ``mean_length_m``,
``length_deviation_m``, ``spacing_m``, ``spacing_deviation_m``, ``persistence``, ``mean_angle_deg``,
``angle_deviation_deg``; values that do not apply to a set are left out. Terminations on other sets, which shorten
traces, are not included.
"""

from __future__ import annotations

import math

import numpy as np

from .joint_sets import FisherAngle, Law, Poles, fisher_rule, mean_pole, poles_about


def of_parallel(angle: Law | FisherAngle, spacing: Law, length: Law | None, gap: Law | None) -> dict[str, float]:
    """Lines ``spacing`` apart, of which the part length / (length + gap) is joint."""
    share = 1.0 if length is None or gap is None or gap.mean == 0 else length.mean / (length.mean + gap.mean)
    out = {
        "p10_per_m": share / spacing.mean,
        "p21_per_m": share / spacing.mean,
        "spacing_m": spacing.mean,
        "spacing_deviation_m": spacing.spread,
        "persistence": share,
        **_angles(angle),
    }
    if share < 1 and spacing is not None and length is not None:
        out |= {
            "p20_per_m2": share / spacing.mean / length.mean,
            "mean_length_m": length.mean,
            "length_deviation_m": length.spread,
        }
    return out


def of_poisson_traces(angle: Law | FisherAngle, length: Law, per_area: float) -> dict[str, float]:
    """Mean statistics of randomly located traces, ``per_area`` of them per m²."""
    p21 = per_area * length.mean
    return {
        "p20_per_m2": per_area,
        "p21_per_m": p21,
        "mean_length_m": length.mean,
        "length_deviation_m": length.spread,
        **_scanned(p21 * angle.mean_cosine),
        **_angles(angle),
    }


def of_poisson_lines(angle: Law | FisherAngle | None, per_area_length: float) -> dict[str, float]:
    """Without ``angle`` all directions are equally likely: a scan-line meets 2/π of the length (Miles 1964)."""
    if angle is None:
        return {"p21_per_m": per_area_length, **_scanned(2 / math.pi * per_area_length)}
    return {"p21_per_m": per_area_length, **_scanned(per_area_length * angle.mean_cosine), **_angles(angle)}


def of_voronoi(cell_area: float) -> dict[str, float]:
    """Cells of random points: 2/√A of edge per area, all directions equally likely (Miles 1970)."""
    p21 = 2 / math.sqrt(cell_area)
    return {"p21_per_m": p21, "p10_per_m": 2 / math.pi * p21, "spacing_m": 0.5 * math.pi / p21}


def of_discs(poles: Poles, diameter: Law, per_volume_area: float) -> dict[str, float]:
    """Discs cut by the section: P21 = P32 E[sin θ] with θ between pole and the section's normal, traces of mean π/4
    E[D²]/E[D] and mean square 2/3 E[D³]/E[D] (Warburton 1980)."""
    mean = mean_pole(poles.dip, poles.dip_direction, poles.section)
    pole = poles_about(mean, poles.fisher, *fisher_rule())
    flat = np.hypot(pole[:, 0], pole[:, 1])
    p21 = per_volume_area * float(flat.mean())
    first, second, third = diameter.moments
    length = 0.25 * math.pi * second / first
    angle = np.arctan2(pole[:, 1], pole[:, 0]) + 0.5 * math.pi
    double = np.exp(2j * angle)
    mean_angle = 0.5 * float(np.angle((flat * double).sum()))
    off = 0.5 * np.angle(double * np.exp(-2j * mean_angle))
    # Steep discs are cut more often than flat ones: each is weighted by its area projected on the section.
    spread = math.sqrt(float(np.average((off - np.average(off, weights=flat)) ** 2, weights=flat)))
    return {
        "p20_per_m2": p21 / length,
        "p21_per_m": p21,
        "mean_length_m": length,
        "length_deviation_m": math.sqrt(max(0.0, 2 / 3 * third / first - length**2)),
        "mean_angle_deg": math.degrees(mean_angle),
        "angle_deviation_deg": math.degrees(spread),
        **_scanned(p21 * float(np.average(np.cos(off), weights=flat))),
    }


def _angles(angle: Law | FisherAngle) -> dict[str, float]:
    return {"mean_angle_deg": math.degrees(angle.mean), "angle_deviation_deg": math.degrees(angle.spread)}


def _scanned(p10: float) -> dict[str, float]:
    """A scan-line meets random traces at exponentially distributed distances (Priest & Hudson 1976)."""
    return {"p10_per_m": p10, "spacing_m": 1 / p10, "spacing_deviation_m": 1 / p10}
