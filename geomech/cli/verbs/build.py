"""``geomech build``: the blocks into which a scene is cut, written and drawn before a run."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..messages import say_warnings
from ..scenes import default_folder, scene_arguments, scenes_asked
from ..verb import DONE, BadInput, Verbs, add_verb, check_folder, check_writable


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    build = add_verb(
        verbs, "build", _build, "write and draw the blocks into which a scene is cut, before a run",
        "geomech build slope.toml\ngeomech build slope.toml --set geometry.seed=7 --out /tmp/seed7",
    )  # fmt: skip
    build.description = str(build.description) + (
        " block_system.json compares the joint sets as specified with those generated; joint_statistics.png shows block"
        " sizes, directions, trace lengths and nodes."
    )
    scene_arguments(build)
    build.add_argument("--out", type=Path, metavar="DIR", help="folder (default outputs/NAME[/VARIANT]/build)")
    build.add_argument(
        "--export",
        type=Path,
        metavar="FILE",
        help="the blocks as a mesh for another program: .inp, .vtk, .bdf, .exo, …",
    )
    build.add_argument(
        "--mesh-size", type=float, metavar="M", help="side of the exported triangles, m (default: as few as possible)"
    )
    build.add_argument("--picture", type=Path, metavar="FILE", help="where the picture goes (default DIR/blocks.png)")


def _build(options: argparse.Namespace) -> int:
    check_folder("--out", options.out)
    check_writable("--picture", options.picture)
    check_writable("--export", options.export)
    if options.mesh_size is not None and not (options.export and options.mesh_size > 0):
        raise BadInput("--mesh-size: a positive length, m, for the mesh that --export writes")
    from ...output.block_model.block_system import write_block_system
    from ...output.block_model.mesh_export import check_format, export_blocks
    from ...render.pictures.block_map import draw_block_map
    from ...scene import load_scene
    from ...scene.drawing import MENDED

    if options.export:
        _refused(lambda: check_format(options.export))
    first = load_scene(options.scene, options.overrides, None, to_run=False)
    scenes = scenes_asked(first, options, to_run=False)
    # Repairs are listed with the lines of each scene.
    say_warnings(scenes.values(), but=MENDED)
    for name, scene in scenes.items():
        folder = options.out or (default_folder(options.scene) / (name or "") / "build")
        folder = folder / name if options.out and name and len(scenes) > 1 else folder
        statistics = write_block_system(scene, folder)
        picture = options.picture or folder / "blocks.png"
        draw_block_map(scene, statistics, picture)
        pictures = str(picture)
        if statistics["sets"]:
            from ...render.pictures.network_statistics import draw_network_statistics

            pictures += f", {draw_network_statistics(scene, statistics, folder / 'joint_statistics.png').name}"
        if options.export:
            target = options.export if len(scenes) == 1 else options.export.with_stem(f"{options.export.stem}_{name}")
            export = partial(export_blocks, scene.problem(), scene.drawing.zones, target, options.mesh_size)
            exported = _refused(export)
            statistics["lines"].append(f"  exported  {exported}")
        print(
            "\n".join(
                [
                    f"{statistics['title']}: {statistics['summary']}",
                    *statistics["lines"],
                    f"  written   {folder}, {pictures}",
                ]
            )
        )
    return DONE


def _refused(export: Callable[[], str | None]) -> str | None:
    """The result of ``export``; its refusals count as bad input."""
    try:
        return export()
    except ValueError as error:
        raise BadInput(f"--export: {error}") from error
