"""Scenes and models that somebody has spoilt: each is refused with its place, or accepted and runs without a traceback.

A seed picks one of the project's scenes and changes its text, or that of the model beside it, in one to three places, as
slips of the hand, lost lines and wrong units do.
"""

import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from geomech.scene import SceneError, load_scene
from geomech.shapes.gmsh_models import isolated_reader

ROOT = Path(__file__).parents[2]
SCENES = sorted(
    path for path in [*ROOT.glob("geometry/*.toml"), *ROOT.glob("pipelines/*/*.toml")]
    if "\n[run]" in path.read_text(encoding="utf-8") or "\n[geometry" in path.read_text(encoding="utf-8")
)  # fmt: skip
NUMBER = re.compile(r"(?<![\w.\"-])-?\d+(?:\.\d*)?(?:e[-+]?\d+)?(?![\w.\"])")
#: What a number may become; "x" is the number itself.
NUMBERS = ("0", "-x", "1e3*x", "1e-3*x", "1e9*x", "1e-9*x", "nan", "inf", "-inf", "1e308", "5e-324", '"x"', "true", "[x]",
           "[]", "{}", "", "9" * 30, "1e400", "0x10", "x x", "2000-01-01")  # fmt: skip
WORDS = ("", "é", "../x", "nan", "crack:", "joint:", "fixed", "a" * 300, "\\u0000", "{}", "%s%n")


#: Scenes of more blocks are read and not run.
LARGE = 60


def changed(text: str, dice: random.Random) -> str:
    """``text`` with one thing changed."""
    lines = text.split("\n")
    at = dice.randrange(len(lines))
    way = dice.choice(["number"] * 5 + ["word"] * 2 + ["lost", "twice", "swapped", "cut", "mark"])
    if way == "number" and (found := list(NUMBER.finditer(text))):
        here = dice.choice(found)
        new = dice.choice(NUMBERS)
        if "*x" in new:
            new = repr(float(here.group()) * float(new.split("*")[0]))
        return text[: here.start()] + new.replace("x", here.group(), 2 if new == "x x" else 1) + text[here.end() :]
    if way == "word" and (found := list(re.finditer(r'"[^"\n]*"', text))):
        here = dice.choice(found)
        return text[: here.start()] + '"' + dice.choice(WORDS) + '"' + text[here.end() :]
    if way == "lost":
        return "\n".join(lines[:at] + lines[at + 1 :])
    if way == "twice":
        return "\n".join(lines[: at + 1] + lines[at:])
    if way == "swapped":
        other = dice.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
        return "\n".join(lines)
    if way == "cut":
        return text[: dice.randrange(len(text))]
    place = dice.randrange(len(text))
    return text[:place] + dice.choice("[]{}\"'=.,;#\\\n\tä%") + text[place + 1 :]


def mutant(seed: int, folder: Path) -> Path:
    """The scene that ``seed`` makes, with what lies beside it, in ``folder``."""
    dice = random.Random(seed)
    scene = dice.choice(SCENES)
    for beside in scene.parent.iterdir():
        if beside.suffix in (".toml", ".geo", ".csv", ".dxf"):
            shutil.copy(beside, folder)
    spoilt = folder / scene.name
    text = spoilt.read_text(encoding="utf-8").replace("../../geometry/", str(ROOT / "geometry") + "/")
    spoilt.write_text(text, encoding="utf-8")
    model = re.search(r'^model = "([^"]*)"', text, re.MULTILINE)
    victim = spoilt
    if model and dice.random() < 0.3:
        victim = folder / Path(model[1]).name
        shutil.copy(ROOT / "geometry" / victim.name, victim)
        spoilt.write_text(text.replace(model[1], victim.name), encoding="utf-8")
    text = victim.read_text(encoding="utf-8")
    for _ in range(dice.randint(1, 3)):
        text = changed(text, dice) if text else text
    victim.write_text(text, encoding="utf-8")
    return spoilt


def accepted(seed: int, folder: Path):
    """The problem of a mutant; None where it is refused, with a place in one of its files."""
    path = mutant(seed, folder)
    try:
        return load_scene(path).problem()
    except SceneError as error:
        assert error.errors
        for fault in error.errors:
            assert re.match(r"\S.*\.(toml|geo|csv|dxf)(:|$)", fault.place), fault
            assert fault.message
            assert fault.way_out
        return None


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("first", range(0, 50, 10))
def test_spoilt_scenes_are_refused_with_their_place_or_read(first, tmp_path, monkeypatch):
    monkeypatch.setattr(isolated_reader, "SECONDS", 5)
    for seed in range(first, first + 10):
        (folder := tmp_path / str(seed)).mkdir()
        accepted(seed, folder)


#: Three steps of a scene in a process of its own: one that never ends is then no more than a test that fails.
_STEPS = """
import sys
from itertools import islice
import numpy as np
from geomech.coupling.cycle import cycles
from geomech.scene import load_scene
for cycle in islice(cycles(load_scene(sys.argv[1]).problem()), 3):
    if not (np.isfinite(cycle.state.vertices).all() and np.isfinite(cycle.state.velocity).all()):
        sys.exit("numbers that are none")
"""


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 2000, 20))
def test_spoilt_scenes_that_are_read_run_a_few_steps(first, tmp_path, monkeypatch):
    monkeypatch.setattr(isolated_reader, "SECONDS", 5)
    for seed in range(first, first + 20):
        (folder := tmp_path / str(seed)).mkdir()
        problem = accepted(seed, folder)
        # Larger ones take long for good reasons.
        if problem is None or problem.blocks.n_blocks > LARGE:
            continue
        done = subprocess.run(
            [sys.executable, "-c", _STEPS, str(mutant(seed, folder))], check=False, capture_output=True, text=True,
            timeout=600,
        )  # fmt: skip
        assert done.returncode == 0 or "NotConverged: " in done.stderr.splitlines()[-1], (seed, done.stderr[-2000:])
