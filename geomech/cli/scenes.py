"""Scenes named on a command line: a file or folder, overridden keys, variants by name."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .verb import BadInput


def scene_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of every verb that takes a scene: its location, keys to override, variants."""
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
        help="a variant of the scene, or 'all' (may be repeated)",
    )  # fmt: skip
    trust_argument(parser)


def scene_place(text: str) -> Path:
    """Location of the scene ``text``: that path, or else the example of this name."""
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
        help="let Gmsh models run commands and read or write any file: only for your own models (otherwise refused)",
    )  # fmt: skip


def scenes_asked(first: Any, options: argparse.Namespace, *, to_run: bool = True) -> dict[str | None, Any]:
    """The requested scenes, by variant; ``first``, which has no variant, if none is requested.

    [run] is required only if they are ``to_run``.
    """
    from ..scene import load_scene

    names = variants_asked(first, options.variants)
    return {name: load_scene(options.scene, options.overrides, name, to_run=to_run) for name in names} or {None: first}


def variants_asked(scene: Any, asked: Sequence[str]) -> list[str]:
    """The names ``asked`` for, once each, with ``all`` expanded; BadInput if the scene has no such variant."""
    known = list(scene.variants)
    names = known if "all" in asked else list(dict.fromkeys(asked))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise BadInput(f"no variant {', '.join(unknown)}; the scene has {', '.join(known) or 'none'}")
    return names


def default_folder(scene: Path) -> Path:
    """``outputs/NAME`` in the working folder; NAME is the pipeline's folder, or the file's name without suffix."""
    scene = scene.resolve()
    return Path("outputs") / (scene.parent.name if scene.name == "scene.toml" else scene.stem)
