"""A borehole breaks out, and is torn open by mud: the crack solver alone, held against closed forms.

`geomech run pipelines/borehole_breakout` calls `main`; copy the folder to make a study of your own.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from borehole import VARIANTS, last_network, steps, wall
from compare_borehole import report


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
    return 0


def picture(runs, file: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5 * len(runs), 5), layout="constrained")
    for axes, (name, run) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items()):
        axes.fill(*wall().T, color="0.9", edgecolor="0.3")
        cracks = last_network(run)
        for start, end in cracks.nodes[cracks.segments]:
            axes.plot(*zip(start, end), color="firebrick", linewidth=1.5)
        axes.set(title=f"{name.replace('_', ' ')}: {cracks.n_cracks} cracks", aspect="equal", xlabel="x (σ_H), m")
    figure.savefig(file, dpi=120)
