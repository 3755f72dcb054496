"""Examples that are installed with geomech: the studies and scenes of its repository, and commented scenes to begin
with.

In a checkout they are in their working folders (``pipelines``, ``geometry``, ``outputs/gallery``); a wheel contains the
same folders in ``geomech/example_files``.
"""

from __future__ import annotations

import ast
import re
import shutil
import tomllib
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
TEMPLATES = HERE / "templates"
#: Path of the geometry and models of a study, relative to it.
_ABOVE = "../../geometry/"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\Z")


class ExampleError(ValueError):
    """There is no such example or template, or the destination exists; the message says what to do."""


class Example(NamedTuple):
    """``place``: a study's folder, or a scene file; ``line``: what it shows; ``picture``: a picture of its result, or
    None."""

    name: str
    line: str
    place: Path
    picture: Path | None


def root() -> Path:
    """The folder that contains ``pipelines`` and ``geometry``. Raises ExampleError if this installation has neither."""
    for folder in (HERE / "example_files", HERE.parent):
        if (folder / "pipelines").is_dir() and (folder / "geometry").is_dir():
            return folder
    raise ExampleError(
        "this installation of geomech came without its examples: install it again from a wheel or a clone"
    )


def examples() -> list[Example]:
    """All studies, then all scenes that do not belong to a study of the same name."""
    folder = root()
    pictures = folder / ("gallery" if folder.name == "example_files" else "outputs/gallery")
    found = {}
    for place in sorted((folder / "pipelines").iterdir()):
        if (place / "run.py").is_file():
            found[place.name] = Example(place.name, _line_of(place), place, _picture(pictures, place.name))
    for place in sorted((folder / "geometry").glob("*.toml")):
        if place.stem not in found:
            found[place.stem] = Example(place.stem, _line_of(place), place, _picture(pictures, place.stem))
    return list(found.values())


def find(name: str) -> Example | None:
    """The example called ``name``, or None."""
    try:
        return next((example for example in examples() if example.name == name), None)
    except ExampleError:
        return None


def copy(name: str, into: Path) -> list[Path]:
    """Copy an example, with the models that it reads, into the new folder ``into``; returns the files written, relative
    to it. Raises ExampleError for an unknown name and if ``into`` exists."""
    example = find(name)
    if example is None:
        names = ", ".join(one.name for one in examples())
        raise ExampleError(f"there is no example {name!r}; there are {names}")
    _refuse_existing(into)
    files = [p for p in sorted(example.place.rglob("*")) if p.is_file()] if example.place.is_dir() else [example.place]
    base = example.place if example.place.is_dir() else example.place.parent
    into.mkdir(parents=True)
    written: dict[str, None] = {}
    for file in files:
        if "__pycache__" in file.parts or file.suffix == ".pyc":
            continue
        target = into / file.relative_to(base)
        target.parent.mkdir(parents=True, exist_ok=True)
        if file.suffix in (".toml", ".py"):
            text = file.read_text(encoding="utf-8")
            for model in _models(text, file.parent):
                shutil.copyfile(model, into / model.name)
                written[model.name] = None
            target.write_text(text.replace(_ABOVE, ""), encoding="utf-8")
        else:
            shutil.copyfile(file, target)
        written[str(target.relative_to(into))] = None
    return [Path(name) for name in sorted(written)]


def new(kind: str, into: Path) -> list[Path]:
    """Write a commented scene of a ``kind`` of `kinds`, and the Gmsh model that it reads, into the new folder ``into``;
    returns the files, relative to it. Raises ExampleError for another kind and if ``into`` exists."""
    if kind not in kinds():
        raise ExampleError(f"there is no start for {kind!r}; there are {', '.join(kinds())}")
    _refuse_existing(into)
    into.mkdir(parents=True)
    shutil.copyfile(TEMPLATES / f"{kind}.geo", into / f"{kind}.geo")
    shutil.copyfile(TEMPLATES / f"{kind}.toml", into / "scene.toml")
    return [Path(f"{kind}.geo"), Path("scene.toml")]


def kinds() -> list[str]:
    """Kinds of scenes that `new` can begin."""
    return sorted(path.stem for path in TEMPLATES.glob("*.toml"))


def _refuse_existing(into: Path) -> None:
    if not _NAME.match(into.name):
        raise ExampleError(f"{into.name!r} is no name for a folder: letters, digits, '_', '-' and '.'")
    if into.exists():
        raise ExampleError(f"{into} exists already: give another name, or move it away")


def _line_of(place: Path) -> str:
    """The title of a scene, or the first sentence of a study's script."""
    scene = place / "scene.toml" if place.is_dir() else place
    if scene.is_file():
        return str(tomllib.loads(scene.read_text(encoding="utf-8")).get("title", place.stem))
    docstring = ast.get_docstring(ast.parse((place / "run.py").read_text(encoding="utf-8"))) or place.name
    return docstring.split("\n\n")[0].replace("\n", " ").split(": ")[0].rstrip(".")


def _picture(folder: Path, name: str) -> Path | None:
    there = (folder / f"{name}.png", folder / f"model_{name}.png", *sorted(folder.glob(f"{name}_*.png")))
    return next((path for path in there if path.is_file()), None)


def _models(text: str, folder: Path) -> list[Path]:
    """Files that a scene or script names, next to it or in the folder of geometry."""
    names = re.findall(r'["\'](?:\.\./\.\./geometry/)([\w.-]+)["\']', text)
    found = [folder / _ABOVE / name for name in names]
    if folder.name == "geometry":
        found += [folder / name for name in re.findall(r'"([\w.-]+\.(?:geo|dxf|msh|csv|geojson))"', text)]
    return [path.resolve() for path in dict.fromkeys(found) if path.is_file()]
