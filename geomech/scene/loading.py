"""Loading of a scene: file, variant, overrides, checks; all errors are reported at once."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from ..model import Blocks, Cracks, Problem
from ..shapes.mesh_exchange import SUFFIXES as OTHER_MESHES
from .assembly.cells import with_cells
from .assembly.drawn_marks import with_marks
from .build import build_problem
from .checks.action_checks import check_actions
from .checks.check import Check
from .checks.cross_checks import check
from .checks.plausibility import check_plausible
from .checks.supported_loads import check_loads
from .drawing import Drawing, draw
from .errors import Fault, SceneError, one_a_cause
from .keys import describe_keys
from .locator import Path, dotted, locate
from .overrides import OverrideError, assign, change_of, flattened
from .overview import overview
from .tables import SceneTables
from .tables.output import OutputTable, RenderTable
from .unbounded_rock import check_endless
from .validation import DECIMAL_COMMA, nearest, validate
from .world import moved

#: The scene file of a pipeline folder.
SCENE_FILE = "scene.toml"

#: Files for geometry.model, which users sometimes give as the scene.
MODELS = (".geo", ".geo_unrolled", ".msh", ".step", ".stp", ".brep", ".dxf", *OTHER_MESHES)

#: Tables and arrays of a scene are nested some six deep; deeper nesting is a mistake or an attack.
DEEPEST = 40


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene that has passed every check.

    ``warnings`` are faults that do not prevent a run. ``tables`` are relative to ``origin`` and include the drawing's
    bolts, water and monitors; the file's own are in world coordinates.
    """

    path: FilePath
    variant: str | None
    tables: SceneTables
    drawing: Drawing
    variants: tuple[str, ...]
    warnings: tuple[Fault, ...] = ()
    _check: Check = field(kw_only=True, repr=False)
    _written: SceneTables = field(kw_only=True, repr=False)

    @property
    def title(self) -> str:
        return self.tables.title or self.name

    @property
    def name(self) -> str:
        """Name for run folders: the pipeline folder's name, or the file's."""
        return self.path.absolute().parent.name if self.path.name == SCENE_FILE else self.path.stem

    @property
    def output(self) -> OutputTable:
        return self.tables.output

    @property
    def render(self) -> RenderTable:
        return self.tables.render

    @property
    def blocks(self) -> Blocks:
        """The drawn blocks, without materials."""
        return self.drawing.assembled()[0]

    @property
    def cracks(self) -> Cracks:
        """The drawn cracks, without apertures."""
        return self.drawing.assembled()[1]

    @property
    def origin(self) -> tuple[float, float]:
        """World coordinates, m, of the origin to which blocks, cracks and results refer."""
        return self.drawing.origin

    def problem(self) -> Problem:
        """The problem for the solvers; its title names the variant."""
        try:
            return replace(build_problem(self.tables, self.drawing, self._check), title=self._full_title)
        except SceneError:
            raise
        except ValueError as error:
            # Values that passed the checks but are refused by the model.
            raise SceneError([Fault(str(self.path), str(error), "")]) from error

    @property
    def _full_title(self) -> str:
        return self.title if self.variant is None else f"{self.title}, {self.variant}"

    def resolved(self) -> dict[str, Any]:
        """The scene with its variant and overrides applied and all defaults written out, ready for ``tomli_w``.

        Paths are absolute, all parameters of a Gmsh model are given, variants are removed. Loading it gives the same
        problem.
        """
        data = self._written.model_dump(by_alias=True, exclude_none=True, exclude={"variants", "sweep"})
        data["title"] = self._full_title
        if any(self.origin):
            data["geometry"]["origin"] = list(self.origin)
        for entry in data["geometry"]["traces"]:
            entry["file"] = str((self.path.parent / entry["file"]).resolve())
        if self.tables.geometry.model is not None:
            data["geometry"]["model"] = str((self.path.parent / self.tables.geometry.model).resolve())
            data["geometry"]["parameters"] = dict(self.drawing.parameters)
        return data

    def overview(self) -> list[str]:
        """Summary of the scene: size, zones, materials, cracks, loads and time."""
        return overview(self.tables, self.drawing)

    @staticmethod
    def describe_keys() -> str:
        """All keys of a scene, with default and description."""
        return describe_keys()


class _Places:
    """Gives the place of a key: file and line, or the override that set it."""

    def __init__(self, shown: str, lines: dict[Path, int]) -> None:
        self.shown, self.lines = shown, lines
        self.changed: dict[Path, tuple[str, float]] = {}
        self.order: dict[str, float] = {}

    def changed_by(self, path: Path, place: str, order: float) -> None:
        self.changed[path] = place, order

    def __call__(self, path: Path) -> str:
        for n in range(len(path), 0, -1):
            if path[:n] in self.changed:
                place, order = self.changed[path[:n]]
                rest = "" if n == len(path) else f" → {dotted(path)}"
                return self._kept(place + rest, order)
            if path[:n] in self.lines:
                return self._kept(f"{self.shown}:{self.lines[path[:n]]}: {dotted(path)}", self.lines[path[:n]])
        return self._kept(f"{self.shown}: {dotted(path)}", 0)

    def _kept(self, place: str, order: float) -> str:
        self.order.setdefault(place, order)
        return place

    def sorted(self, faults: list[Fault]) -> list[Fault]:
        return sorted(dict.fromkeys(faults), key=lambda fault: self.order.get(fault.place, 0))


def load_scene(
    path: str | FilePath,
    overrides: Iterable[str | tuple[str, Any]] | Mapping[str, Any] = (),
    variant: str | None = None,
    *,
    to_run: bool = True,
) -> Scene:
    """Load, override and check a scene.

    ``path`` is a .toml file or a pipeline folder (then its scene.toml); ``variant`` one of the scene's [variants];
    ``overrides`` are further changes, {"section.key": value} with Python values, or a list of "section.key=value" with
    values in TOML syntax or bare words. Raises SceneError with all faults: place (file, line, key), message and way
    out. A scene that is not ``to_run`` may lack [run].

    >>> scene = geomech.load_scene("slope.toml", {"joints.default.friction_angle_deg": 40})
    >>> scene.problem().blocks.n_blocks
    2
    """
    path = _file(FilePath(path))
    data, text = _parsed(path)
    places = _Places(str(path), locate(text))
    faults: list[Fault] = []
    warnings: list[Fault] = []
    variants = data.get("variants", {})
    names = tuple(variants) if isinstance(variants, dict) else ()

    plain = copy.deepcopy(data)
    if variant is not None:
        if variant not in names:
            raise SceneError([Fault(str(path), f"the scene has no variant {variant!r}", nearest(variant, list(names)))])
        _apply_variant(data, variant, places, faults)
    if isinstance(overrides, str):
        way = 'write ["section.key=value"] or {"section.key": value}'
        raise SceneError([Fault(str(path), f"{overrides!r} is a single string", way)])
    changes: Iterable[str | tuple[str, Any]] = overrides.items() if isinstance(overrides, Mapping) else overrides
    for number, one in enumerate(changes):
        called = f"--set {one}" if isinstance(one, str) else f"{one[0]} = {one[1]!r}"
        try:
            key, value = change_of(one)
            # Overrides are listed after the file's own faults.
            places.changed_by(assign(data, key, value), called, 1e9 + number)
        except OverrideError as error:
            faults.append(Fault(called, error.message, error.way_out))

    if not to_run and "run" not in data:
        data["run"] = _some_run(data)
    _refuse_null_characters(data, places, faults)
    _resolve_records(data, path.parent)
    tables, found = validate(data, places)
    faults += found
    if not found:
        _check_variants(plain, names, variant, path, places.lines, faults)
    drawing = None
    if tables.geometry is not None:
        drawing = draw(tables.geometry, path.parent, places, faults, warnings)
    written = tables
    place: Callable[[Path], str] = places
    if drawing is not None:
        tables, place = with_marks(moved(tables, drawing.origin), drawing, places, faults, warnings)
        drawing = with_cells(tables, drawing, place, faults)
    sections = Check(tables, data, drawing, place, faults, warnings)
    check(sections)
    check_actions(sections)
    check_endless(sections)
    check_loads(sections)
    if faults:
        raise SceneError(places.sorted(faults))
    check_plausible(sections)
    # Building repeats the checks; their faults are known already.
    quiet = Check(tables, data, drawing, place, [], [])
    return Scene(
        path,
        variant,
        tables,
        quiet.drawn,
        names,
        tuple(places.sorted(one_a_cause(warnings))),
        _check=quiet,
        _written=written,
    )


def _file(path: FilePath) -> FilePath:
    if path.is_dir():
        inside = path / SCENE_FILE
        if not inside.is_file():
            others = ", ".join(sorted(p.name for p in path.glob("*.toml")))
            way = f"name one of {others}" if others else "name a scene file, or a folder that holds one"
            raise SceneError([Fault(str(path), f"the folder holds no {SCENE_FILE}", way)])
        return inside
    if path.is_file() and path.suffix.lower() in MODELS:
        way = f'write a scene file with [geometry] model = "{path.name}"; a folder\'s is called {SCENE_FILE}'
        raise SceneError([Fault(str(path), "this is a drawing, not a scene", way)])
    if not path.is_file():
        near = [str(path.parent / p.name) for p in path.parent.iterdir()] if path.parent.is_dir() else []
        near = [n for n in near if n.endswith(".toml") or FilePath(n, SCENE_FILE).is_file()]
        raise SceneError(
            [Fault(str(path), "there is no such scene", nearest(str(path), near) if near else "check the path")]
        )
    return path


def _parsed(path: FilePath) -> tuple[dict[str, Any], str]:
    try:
        # Line ends as tomllib sees them, so that line numbers agree; editors on Windows put a mark at the beginning.
        text = path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
        data = tomllib.loads(text)
        if _is_deep(data):
            raise RecursionError
        return data, text
    except RecursionError:
        line = _deepest_line(text)
        message = f"tables and arrays are nested deeper than {DEEPEST}"
        fault = Fault(f"{path}:{line}", message, "no key of a scene needs that: is a bracket not closed?")
        raise SceneError([fault]) from None
    except UnicodeDecodeError as error:
        raise SceneError([Fault(str(path), f"the file is not UTF-8 text ({error})", "save it as UTF-8")]) from error
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\(at (?:line (\d+), column (\d+)|end of document)\)", str(error))
        message = str(error)[: found.start()].strip() if found else str(error)
        place = found.group(1) if found and found.group(1) else str(text.count("\n") + 1)
        column = f", column {found.group(2)}" if found and found.group(2) else ""
        source = text.splitlines()[int(place) - 1].strip() if 0 < int(place) <= len(text.splitlines()) else ""
        raise SceneError(
            [
                Fault(
                    f"{path}:{place}{column}",
                    f"not valid TOML: {message}" + (f", in `{source}`" if source else ""),
                    _syntax_hint(source),
                )
            ]
        ) from error
    except ValueError as error:
        # Python reads no integers with more digits than `sys.get_int_max_str_digits`.
        line = max(enumerate(text.split("\n"), 1), key=lambda found: sum(map(str.isdigit, found[1])))[0]
        fault = Fault(f"{path}:{line}", f"not a number: {error}", "write large numbers as 1e9")
        raise SceneError([fault]) from error


def _is_deep(data: Any) -> bool:
    """Whether a parsed document is nested deeper than `DEEPEST`; without recursion."""
    level = [data]
    for _ in range(DEEPEST):
        level = [item for node in level if isinstance(node, (dict, list))
                 for item in (node.values() if isinstance(node, dict) else node)]  # fmt: skip
        if not level:
            return False
    return True


def _deepest_line(text: str) -> int:
    """First line at which more than `DEEPEST` brackets are open, or a key has as many dots; brackets in texts count as
    well."""
    open_ones = 0
    for number, line in enumerate(text.split("\n"), 1):
        for character in line.partition("#")[0]:
            open_ones += (character in "[{") - (character in "]}")
            if open_ones > DEEPEST:
                return number
        if line.partition("=")[0].count(".") >= DEEPEST:
            return number
    return 1


def _syntax_hint(source: str) -> str:
    """Suggestion for the invalid line ``source``."""
    value = source.partition("=")[2].partition("#")[0].strip()
    if re.fullmatch(DECIMAL_COMMA, value):
        return f"numbers have a decimal point: {value.replace(',', '.')}"
    if value.lower() in ("true", "false"):
        return f"write {value.lower()} in lower case"
    return "put texts in double quotes and arrays in square brackets, and give each key once"


def _some_run(data: dict[str, Any]) -> dict[str, float]:
    """A [run] for a scene that is drawn only: one step."""
    step = data["dda"].get("time_step_s") if isinstance(data.get("dda"), dict) else None
    return {"end_time_s": max(1.0, step) if isinstance(step, float | int) else 1.0}


def _refuse_null_characters(data: dict[str, Any], places: _Places, faults: list[Fault]) -> None:
    way_out = "remove \\u0000: no name of a file or a part can have it"
    broken = [Fault(places(path), "the text contains a null character", way_out) for path in _null_characters(data)]
    if broken:
        raise SceneError(places.sorted(faults + broken))


def _null_characters(data: Any, path: Path = ()) -> Iterator[Path]:
    """Paths of texts in ``data`` with a null character, which neither file systems nor other programs' libraries take."""
    if isinstance(data, str) and "\0" in data:
        yield path
    parts = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in parts:
        # Names of variants are names of folders, which are checked as such.
        if "\0" in str(key) and path != ("variants",):
            yield path
        else:
            yield from _null_characters(value, (*path, key))


def _resolve_records(data: dict[str, Any], folder: FilePath) -> None:
    """Make paths of load files absolute, in place: they are relative to the scene, and a resolved scene may be
    elsewhere."""
    loads = data.get("loads")
    for entry in loads.values() if isinstance(loads, dict) else ():
        for table in entry if isinstance(entry, list) else [entry]:
            if isinstance(table, dict) and isinstance(table.get("file"), str):
                table["file"] = str((folder / table["file"]).resolve())


def _apply_variant(data: dict[str, Any], name: str, places: _Places, faults: list[Fault]) -> None:
    changes = data["variants"][name]
    if not isinstance(changes, dict):
        return  # reported by the checks of the tables
    for own, target, value in flattened(changes):
        here = ("variants", name, *own)
        line = places.lines.get(here, 0)
        shown = f"{places.shown}:{line}: variants.{name} → {dotted(target)}"
        try:
            places.changed_by(assign(data, target, value), shown, line)
        except OverrideError as error:
            faults.append(Fault(places(here), error.message, error.way_out))


def _check_variants(
    data: dict[str, Any], names: Sequence[str], chosen: str | None, path: FilePath, lines: dict[Path, int],
    faults: list[Fault],
) -> None:  # fmt: skip
    """Check the tables of all other variants too: a typing error should be found before its variant is run."""
    for name in names:
        if name == chosen:
            continue
        own = copy.deepcopy(data)
        places = _Places(str(path), lines)
        _apply_variant(own, name, places, faults)
        faults += [f for f in validate(own, places)[1] if f"variants.{name} →" in f.place]
