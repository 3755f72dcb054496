"""A borehole breaks out, and is fractured by mud pressure: the crack solver alone, compared with closed forms.

`geomech run pipelines/borehole_breakout` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from borehole import RADIUS, VARIANTS, last_network, steps, wall
from compare_borehole import check, report


def main(folder: Path, out: Path, overrides=(), variants=(), quiet: bool = False) -> int:
    if overrides:
        raise ValueError("this study has no scene to override: change borehole.py")
    runs = {name: steps(name) for name in variants or VARIANTS}
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    text = report(runs)
    (out / "comparison.txt").write_text(text + "\n", encoding="utf-8")
    picture(runs, out / "borehole.png")
    if not quiet:
        print(text)
    check(runs)
    return 0


def picture(runs, file: Path) -> None:
    from matplotlib.figure import Figure

    # A chip of the wall is a hundredth of the hole: only the top of it is shown.
    views = {"breakout": ((-0.2, 0.2), (0.88, 1.12))}
    figure = Figure(figsize=(5 * len(runs), 3.8), layout="constrained")
    for axes, (name, run) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items()):
        cracks, (x, y) = last_network(run), views.get(name, ((-3.0, 3.0), (-1.8, 1.8)))
        axes.fill(*wall().T / RADIUS, color="white", edgecolor="0.3")
        for start, end in cracks.nodes[cracks.segments] / RADIUS:
            axes.plot(*zip(start, end), color="firebrick", linewidth=2, solid_capstyle="round")
        axes.set(title=name.replace("_", " "), aspect="equal", xlim=x, ylim=y, facecolor="0.88")
        axes.set(xlabel=r"along $\sigma_H$, radii", ylabel=r"along $\sigma_h$, radii")
    figure.savefig(file, dpi=120)
