"""The study of the tunnel's roof, run as the command line runs it; its own check asserts statics, K_Ic and Newton."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from geomech.cli import DONE, main
from geomech.output import Run
from geomech.reference.openings import roof_block

FOLDER = Path(__file__).parents[2] / "pipelines" / "tunnel_roof"
sys.path.insert(0, str(FOLDER))
import compare_tunnel_roof as study

FEW_FILES = ("--set", "output.interior=false", "--set", "output.every=1000")


def ran(out: Path, *variants: str) -> dict[str, study.Watch]:
    """What the study's observers saw of ``variants``."""
    seen, checked = {}, study.check

    def keep(runs):
        checked(runs)
        seen.update(runs)

    study.check = keep
    try:
        named = [word for name in variants for word in ("--variant", name)]
        assert main(["run", str(FOLDER), "--quiet", "--out", str(out), *named, *FEW_FILES]) == DONE
    finally:
        study.check = checked
    for name in variants:
        # Of the energy converted, in any cycle.
        assert np.nanmax(np.abs(Run(out / name).history["budget_residual"])) < 0.01
    return seen


def test_bridge_breaks_and_block_falls_as_limit_equilibrium_has_it(verified, tmp_path):
    seen = ran(tmp_path, "rough", "falls")
    verified("key block that falls: acceleration", seen["falls"].acceleration / 9.81 - 1, "Newton")
    assert seen["falls"].acceleration == pytest.approx(9.81, rel=1e-6)
    assert "Newton" in (tmp_path / "comparison.txt").read_text(encoding="utf-8")
    kinds = {str(event["kind"]) for event in Run(tmp_path / "rough").events}
    assert {"initiation", "coalescence", "split"} <= kinds


@pytest.mark.slow
def test_walls_hold_squeeze_and_let_go(tmp_path):
    seen = ran(tmp_path, "open", "squeezed", "slides", "held", "let_go")
    assert seen["held"].newton == 0.0 and not seen["held"].parted
    assert seen["let_go"].newton == pytest.approx(0.02 * 9.81, rel=0.01)


def test_shorter_bridges_are_nearer_to_half_planes(verified, tmp_path):
    """The bridge's force from K_I = P/√(πc): its error falls with c, and so does what the roof's bending shears it."""
    errors, shears = [], []
    for half in (0.2, 0.1, 0.05):
        left, right = f"[[-2,7],[-{half},7]]", f"[[2,7],[{half},7]]"
        cracks = f'[{{name="parting left", points={left}}}, {{name="parting right", points={right}}}]'
        out = tmp_path / f"{half}"
        assert (
            main(
                ["run", str(FOLDER / "scene.toml"), "--quiet", "--out", str(out), *FEW_FILES]
                + ["--set", f"geometry.cracks={cracks}", "--set", "materials.rock.k_ic_pa_sqrt_m=4e6"]
            )
            == DONE
        )
        tips = Run(out).tips[-2:]
        weight = 9 * 2600 * 9.81
        errors.append(abs(tips["K_I"].mean() / roof_block.ligament_factor(weight, half) - 1))
        shears.append(abs(tips["K_II"] / tips["K_I"]).mean())
    print(f"errors of the force {errors}, K_II/K_I {shears}")
    verified(
        "bridge that holds a key block: its force from K",
        errors,
        "statics of the wedge",
        over=("half-width of the bridge, m", (0.2, 0.1, 0.05)),
    )
    assert errors[2] < errors[1] < errors[0] < 0.03
    assert shears[2] < 0.6 * shears[1] < 0.36 * shears[0]


def test_reference_holds_at_its_limits():
    alpha, phi = math.atan(0.25), math.radians(35)
    least = roof_block.least_thrust(1.0, alpha, phi)
    assert roof_block.bridge_force(1.0, least, alpha, phi) == pytest.approx(0.0, abs=1e-15)
    assert roof_block.bridge_force(1.0, 0.3, alpha, 0.0) == pytest.approx(1 + 0.6 * 0.25)
    assert roof_block.acceleration(1.0, 1.01 * least, alpha, phi) == 0.0
    assert roof_block.acceleration(1.0, 0.0, alpha, phi, wall_mass=1e-3) == 9.81
