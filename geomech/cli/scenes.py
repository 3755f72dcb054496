"""The scenes that a command line asks for: a file or folder, keys overridden, variants by name."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .verb import BadInput


def scene_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of every verb that takes a scene: where it is, keys to override, variants."""
    parser.add_argument(
        "scene", type=scene_place, metavar="SCENE",
        help="a scene.toml, a folder that holds one, or the name of an example",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="override a key of the scene, e.g. growth.increment_m=2e-3 (may be repeated)",
    )  # fmt: skip
    parser.add_argument(
        "--variant", action="append", default=[], metavar="NAME", dest="variants",
        help="a variant that the scene names, or 'all' (may be repeated)",
    )  # fmt: skip
    trust_argument(parser)


def scene_place(text: str) -> Path:
    """Where the scene ``text`` is: that path, or where there is none the example of this name."""
    place = Path(text)
    if place.exists() or place.name != text:
        return place
    from ..examples import find

    example = find(text)
    return place if example is None else example.place


def trust_argument(parser: argparse.ArgumentParser) -> None:
    """The argument of every verb that reads models."""
    parser.add_argument(
        "--trust-models", action="store_true",
        help="let Gmsh models run commands, write files and read any: of your own alone (else they are refused)",
    )  # fmt: skip


def scenes_asked(first: Any, options: argparse.Namespace, *, to_run: bool = True) -> dict[str | None, Any]:
    """The scenes that are asked for, by variant, [run] only where they are ``to_run``; ``first``, which has none, where
    none is asked for."""
    from ..scene import load_scene

    names = variants_asked(first, options.variants)
    return {name: load_scene(options.scene, options.overrides, name, to_run=to_run) for name in names} or {None: first}


def variants_asked(scene: Any, asked: Sequence[str]) -> list[str]:
    """The names ``asked`` for, once each, ``all`` of them spelled out; BadInput where the scene has no such variant."""
    known = list(scene.variants)
    names = known if "all" in asked else list(dict.fromkeys(asked))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise BadInput(f"no variant {', '.join(unknown)}; the scene has {', '.join(known) or 'none'}")
    return names


def default_folder(scene: Path) -> Path:
    """``outputs/NAME`` below the working folder: NAME is the pipeline's folder, or the file's name without suffix."""
    scene = scene.resolve()
    return Path("outputs") / (scene.parent.name if scene.name == "scene.toml" else scene.stem)
