"""The plan of a sweep: a scene, its variables, and the measured quantity. All faults are reported before any run."""

from __future__ import annotations

import copy
import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ..scene import Fault, SceneError, load_scene
from ..scene.keys import field_of, keys_of, kind_of, table_at
from ..scene.loading import SCENE_FILE
from ..scene.locator import dotted, locate, path_of
from ..scene.overrides import OverrideError, assign
from ..scene.validation import nearest, validate, validate_sweep
from .expressions import ExpressionError, evaluate, margin_of, names_in, parsed
from .sampling import Design, correlation_matrix, run_table
from .variables import Listed, Random, Variable, VariableError, variable

#: File with the settings of a sweep, in the folder of the scene.
SWEEP_FILE = "sweep.toml"
#: Largest probability of a value outside the bounds of its key.
_OUTSIDE = 1e-9
#: More runs than this are refused unless ``limit`` allows them.
LIMIT = 10_000
#: Number of scenes that are built in advance; the sweep is refused if none of them can be built.
_DRAWN = 3
FAILS = {"safety": "factor_of_safety < 1", "run": "moving_blocks > 0", "pause": "false"}
#: Number of cells along the longer side of the map of moving places.
_CELLS = 72


@dataclass(frozen=True)
class Plan:
    """A checked plan. ``settings``: [sweep]; ``variables``: in column order; ``keys``: variable name → key of the
    scene; ``derived``: key → expression; ``seeds`` of joint sets; ``box`` (x0, y0, x1, y1) m and ``cells`` (nx, ny) of
    the map of moving places."""

    scene: Path
    variant: str | None
    overrides: tuple[str, ...]
    settings: dict[str, Any]
    variables: tuple[Variable, ...]
    keys: dict[str, str]
    derived: dict[str, str]
    seeds: tuple[int, ...]
    title: str = ""
    box: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    cells: tuple[int, int] = (1, 1)
    warnings: tuple[str, ...] = field(default=(), compare=False)

    @property
    def design(self) -> Design:
        runs = self.settings["runs"] or max(1, len(self.seeds))
        pairs = tuple((*each["between"], each["coefficient"]) for each in self.settings["correlated"])
        return Design(self.settings["sampling"], runs, self.settings["seed"], pairs)

    @property
    def fails(self) -> str:
        return self.settings["fails"] or FAILS[self.settings["measure"]]

    @property
    def result(self) -> str:
        """The column that is reported first: the one compared in `fails`, otherwise that of the measure."""
        first = next((name for name in sorted(names_in(self.fails)) if "." not in name), None)
        return (
            first
            or {"safety": "factor_of_safety", "run": "largest_displacement_m", "pause": "value"}[
                self.settings["measure"]
            ]
        )

    @property
    def random(self) -> tuple[Random, ...]:
        return tuple(each for each in self.variables if isinstance(each, Random))

    @cached_property
    def table(self) -> list[dict[str, Any]]:
        """The values of every run by variable, and its "seed"."""
        return run_table(self.variables, self.design, self.seeds)

    def changes(self, values: Mapping[str, Any]) -> tuple[str, ...]:
        """The overrides "key=value" of the scene for a run with these ``values``."""
        found = [f"{self.keys[name]}={_toml(value)}" for name, value in values.items() if name in self.keys]
        if "seed" in values:
            found.append(f"geometry.seed={values['seed']}")
        if self.derived:
            numbers = {name: value for name, value in values.items()}
            for key, text in self.derived.items():
                found.append(f"{key}={_toml(evaluate(text, numbers))}")
        return (*self.overrides, *found)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, the same for the same plan."""
        return {
            "scene": str(self.scene), "variant": self.variant, "overrides": list(self.overrides),
            "settings": json.loads(json.dumps(self.settings)),
        }  # fmt: skip

    def how_to_repeat(self, values: Mapping[str, Any]) -> str:
        """The command that repeats the single run with these ``values``."""
        import shlex

        verb = "safety" if self.settings["measure"] == "safety" else "run"
        words = ["geomech", verb, str(self.scene)]
        words += ["--variant", self.variant] if self.variant else []
        words += [word for change in self.changes(values) for word in ("--set", change)]
        if verb == "safety":
            words += ["--without-cracks"] if self.settings["without_cracks"] else []
            words += ["--along", *self.settings["along"]] if self.settings["along"] else []
            divided = [f"{name}={value:g}" for name, value in self.settings["divide"].items()]
            words += ["--divide", *divided] if divided else []
        return shlex.join(words)


def plan_of(
    scene: str | Path,
    given: Mapping[str, Any] | None = None,
    *,
    overrides: Sequence[str] = (),
    variant: str | None = None,
    table: str | Path | None = None,
    limit: int | None = None,
    source: str = "",
    alone: bool = False,
) -> Plan:
    """The plan of a sweep over ``scene``. Settings are taken from ``given``, then from the file ``table`` (default:
    sweep.toml in the scene's folder, if it exists), then from [sweep] of the scene; `vary`, `derive` and `columns` are
    merged by name. ``limit``: largest number of runs (default 10 000). ``source``: prefix of the names of given
    settings in messages ("--"). ``alone``: use the given settings only.

    Raises SceneError with every fault: unknown keys, empty ranges, distributions beyond a key's bounds …
    """
    path = Path(scene)
    path = path / SCENE_FILE if path.is_dir() else path
    base = load_scene(path, overrides, variant, to_run=False)
    merged, place, faults = _merged(base, Path(table) if table else None, dict(given or {}), source, alone)
    settings, wrong = validate_sweep(merged, place)
    if settings is None or faults:
        raise SceneError([*faults, *wrong])
    if settings.measure == "run" and "run" not in tomllib.loads(path.read_text(encoding="utf-8-sig")):
        load_scene(path, overrides, variant)  # reports that [run] is missing
    checker = _Checker(base, settings, place)
    plan = checker.plan(path.resolve(), tuple(overrides), variant)
    if checker.faults:
        raise SceneError(checker.faults)
    checker.check_runs(plan, LIMIT if limit is None else limit)
    if checker.faults:
        raise SceneError(checker.faults)
    checker.check_values(plan)
    if checker.faults:
        raise SceneError(checker.faults)
    checker.check_scenes(plan)
    return plan


def read_plan(data: Mapping[str, Any]) -> Plan:
    """The plan from the data of `Plan.as_dict`, checked again. Raises SceneError."""
    return plan_of(
        data["scene"], data["settings"], overrides=data["overrides"], variant=data["variant"], limit=10**9, alone=True
    )


def _merged(base: Any, table: Path | None, given: dict[str, Any], source: str, alone: bool):
    """The settings from all three sources, a function that gives the place of each, and faults."""
    sources: list[tuple[dict[str, Any], Any]] = []
    faults: list[Fault] = []
    if base.tables.sweep is not None and not alone:
        written = base.tables.sweep.model_dump(exclude_unset=True)
        sources.append((written, lambda path: f"{base.path}: {'.'.join(map(str, path))}"))
    sweep_file = base.path.parent / SWEEP_FILE
    if not alone and (table is not None or sweep_file.is_file()):
        file = table or sweep_file
        try:
            text = file.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
            data = tomllib.loads(text)
            lines = locate(text)
            if set(data) == {"sweep"}:
                data, lines = data["sweep"], {path[1:]: line for path, line in lines.items()}
            sources.append((data, lambda path: _in_file(file, lines, path[1:])))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            faults.append(Fault(str(file), f"it cannot be read: {error}", "write the keys of [sweep] as TOML"))
    sources.append((given, lambda path: source + " ".join(map(str, path[1:]))))
    merged: dict[str, Any] = {}
    places: dict[tuple[str, ...], Any] = {}
    for data, where in sources:
        for key, value in data.items():
            if key in ("vary", "derive") and isinstance(value, Mapping):
                value = _by_key(value)
            if (
                key in ("vary", "derive", "columns")
                and isinstance(value, Mapping)
                and isinstance(merged.get(key), dict)
            ):
                merged[key] = {**merged[key], **value}
                places |= {(key, name): where for name in value}
                places.setdefault((key,), where)
            else:
                merged[key] = value
                places[(key,)] = where
                places |= {(key, name): where for name in value} if isinstance(value, Mapping) else {}

    def place(path: tuple[str | int, ...]) -> str:
        for n in (3, 2):
            key = tuple(str(part) for part in path[1:n])
            if key in places:
                return places[key](path)
        return dotted(path)

    return merged, place, faults


def _in_file(file: Path, lines: Mapping[Any, int], path: tuple[str | int, ...]) -> str:
    written = [path, (path[0], *path_of(str(path[1])))] if len(path) == 2 else [path]
    found = [lines[each[:n]] for each in written for n in range(len(each), 1, -1) if each[:n] in lines]
    line = found[0] if found else lines.get(path[:1])
    return f"{file}{f':{line}' if line else ''}: {'.'.join(map(str, path))}"


def _by_key(data: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of tables as one table of dotted keys; a table with `law` is a distribution."""
    found: dict[str, Any] = {}

    def walk(node: Mapping[str, Any], above: str) -> None:
        for key, value in node.items():
            name = f"{above}.{key}" if above else key
            if isinstance(value, Mapping) and "law" not in value:
                walk(value, name)
            else:
                found[name] = value

    walk(data, "")
    return found


def seeds_of(written: Any) -> tuple[int, ...]:
    """ "0-499", "0-9, 20" or whole numbers as seeds, each once. Raises ValueError."""
    if written is None:
        return ()
    if not isinstance(written, str):
        found = [int(seed) for seed in written]
    else:
        found = []
        for part in written.split(","):
            first, dash, last = part.strip().partition("-")
            if not first.isdecimal() or (dash and not last.isdecimal()) or (dash and int(last) < int(first)):
                raise ValueError(f"{part.strip()!r} is not an ascending range of seeds")
            found += range(int(first), int(last or first) + 1)
    if not found or min(found) < 0:
        raise ValueError("seeds are whole numbers ≥ 0; give at least one")
    if len(set(found)) < len(found):
        raise ValueError("a seed is given twice")
    return tuple(found)


class _Checker:
    """Collects the faults of a sweep over the scene ``base``."""

    def __init__(self, base: Any, settings: Any, place: Any) -> None:
        self.base, self.settings, self.place = base, settings, place
        self.faults: list[Fault] = []
        self.data = json.loads(json.dumps(base.resolved()))

    def refuse(self, where: Sequence[str | int], message: str, way_out: str) -> None:
        self.faults.append(Fault(self.place(("sweep", *where)), message, way_out))

    def plan(self, path: Path, overrides: tuple[str, ...], variant: str | None) -> Plan:
        settings = self.settings
        variables, keys, derived = [], {}, {}
        for name, written in _by_key(settings.vary).items():
            try:
                made = variable(name, written)
            except VariableError as error:
                self.refuse(("vary", name), error.message, error.way_out)
                continue
            variables.append(made)
            if "." in name:
                key = self._key(("vary", name), name)
                if key is not None:
                    keys[name] = key
                    self._check_kind(made, key)
            elif not name.isidentifier():
                self.refuse(
                    ("vary", name),
                    f"{name!r} is neither a key of the scene nor a name",
                    "write section.key, or a single word",
                )
        names = {each.name for each in variables} | {"seed"}
        for name, text in _by_key(settings.derive).items():
            key = self._key(("derive", name), name)
            if key is not None and self._expression(("derive", name), str(text), names):
                derived[key] = str(text)
        used = {name for text in derived.values() for name in names_in(text)}
        for each in variables:
            if "." not in each.name and each.name not in used:
                self.refuse(
                    ("vary", each.name),
                    f"{each.name!r} sets nothing",
                    "write a key of the scene with its section, or use it in `derive`",
                )
        twice = [key for key in derived if key in keys.values()]
        if twice:
            self.refuse(("derive", twice[0]), "the key is both varied and derived", "leave one of them out")
        plain = json.loads(settings.model_dump_json())
        plain["vary"], plain["derive"] = _by_key(settings.vary), _by_key(settings.derive)
        box, cells = _map_of(self.base)
        return Plan(
            path, variant, overrides, plain, tuple(variables), keys, derived, self._seeds(),
            self.base.problem().title or self.base.name, box, cells, tuple(self._warnings(variables)),
        )  # fmt: skip

    def _warnings(self, variables: Sequence[Variable]) -> Iterator[str]:
        runs = self.settings.runs or 0
        if self.settings.sampling == "sobol" and runs & (runs - 1):
            yield f"Sobol' points are spread evenly in powers of two: {1 << runs.bit_length()} rather than {runs}"
        random = sum(isinstance(each, Random) for each in variables)
        if self.settings.sampling == "saltelli" and random and runs % (random + 2):
            whole = runs // (random + 2) * (random + 2)
            yield f"Saltelli's design takes {random + 2} runs a group: {whole} of {runs} are run"

    def _seeds(self) -> tuple[int, ...]:
        try:
            seeds = seeds_of(self.settings.seeds)
        except (ValueError, TypeError) as error:
            self.refuse(("seeds",), str(error), 'write a range such as "0-499", or a list of whole numbers')
            return ()
        if seeds and not self.base.tables.geometry.joint_sets:
            self.refuse(
                ("seeds",),
                "the scene has no joint sets: every seed gives the same blocks",
                "leave `seeds` out, or draw [[geometry.joint_sets]]",
            )
        return seeds

    def _key(self, where: tuple[str, str], name: str) -> str | None:
        """The key ``name`` in the scene's spelling, with list items by number; None, and a fault, if it does not
        exist."""
        path: list[str | int] = []
        node: Any = self.data
        for part in path_of(name):
            table = table_at(tuple(path))
            if isinstance(node, list):
                named = [k for k, each in enumerate(node) if isinstance(each, dict) and each.get("name") == part]
                if not str(part).isdecimal() and len(named) != 1:
                    known = [str(each.get("name")) for each in node if isinstance(each, dict) and each.get("name")]
                    self.refuse(
                        where,
                        f"{dotted(tuple(path))} has no item {part!r}",
                        nearest(str(part), known) if known else f"number them from 0 to {len(node) - 1}",
                    )
                    return None
                part = named[0] if named else int(part)
                if part >= len(node):
                    self.refuse(where, f"{dotted(tuple(path))} has {len(node)} items", "they are numbered from 0")
                    return None
                node = node[part]
            elif table is not None and field_of(table, part) is None:
                self.refuse(
                    where, f"the scene has no key {dotted((*path, part))!r}", nearest(str(part), keys_of(table))
                )
                return None
            elif table is None and isinstance(node, dict) and part not in node and self._is_map(path):
                self.refuse(where, f"the scene has no {dotted((*path, part))!r}", nearest(str(part), list(node)))
                return None
            else:
                node = node.get(part) if isinstance(node, dict) else None
            path.append(part)
        return dotted(tuple(path))

    def _is_map(self, path: Sequence[str | int]) -> bool:
        """Whether ``path`` is a map from names chosen in the scene to tables."""
        table = table_at(tuple(path[:-1])) if path else None
        found = field_of(table, path[-1]) if table is not None else None
        return found is not None and kind_of(found.annotation)[0] == "map" and path[-1] != "parameters"

    def _check_kind(self, made: Variable, key: str) -> None:
        """Check that values have the key's type, and distributions are within its bounds."""
        path = tuple(int(part) if str(part).isdecimal() else part for part in path_of(key))
        table = table_at(path[:-1])
        found = field_of(table, path[-1]) if table is not None else None
        if found is None or not isinstance(made, Random):
            return
        kind = kind_of(found.annotation)[1]
        if kind is int:
            self.refuse(
                ("vary", made.name), "the key takes whole numbers", "list them, or write a range, such as 1:9:2"
            )
            return
        low, high = -math.inf, math.inf
        metadata = [*found.metadata, *getattr(found.annotation, "__metadata__", ())]
        for argument in getattr(found.annotation, "__args__", ()):
            metadata += getattr(argument, "__metadata__", ())
        for entry in [inner for each in metadata for inner in (each, *getattr(each, "metadata", ()))]:
            for bound in ("gt", "ge"):
                value = getattr(entry, bound, None)
                low = low if value is None else max(low, float(value))
            for bound in ("lt", "le"):
                value = getattr(entry, bound, None)
                high = high if value is None else min(high, float(value))
        outside = made.outside(low, high)
        if outside > _OUTSIDE:
            within = (*made.parameters, max(low, made.low), min(high, made.high))
            cut = f"{made.law}({', '.join(f'{x:g}' for x in within)})"
            self.refuse(
                ("vary", made.name),
                f"{made} lies outside {low:g} to {high:g}, the permitted range of the key, with probability {outside:.2g}",
                f"truncate it, for example {cut}"
                if made.law in ("normal", "lognormal", "exponential")
                else "set its bounds within",
            )

    def _expression(self, where: tuple[str, str], text: str, names: set[str]) -> bool:
        try:
            parsed(text)
            unknown = sorted(name for name in names_in(text) if name not in names)
        except ExpressionError as error:
            self.refuse(where, str(error), "write an expression of the variables, such as 0.5 * z")
            return False
        if unknown:
            self.refuse(where, f"there is no variable {unknown[0]!r}", nearest(unknown[0], sorted(names)))
        return not unknown

    def check_runs(self, plan: Plan, limit: int) -> None:
        """Check the number of runs, samples, correlations and expressions, and try some scenes."""
        self._check_samples(plan)
        self._check_rare(plan)
        self._check_correlations(plan)
        self._check_expressions()
        count = math.prod(len(each.values) for each in plan.variables if isinstance(each, Listed))
        count *= plan.design.runs if plan.random else max(1, len(plan.seeds))
        if count > limit:
            where, message = ("sweep", "runs"), f"{count} runs, more than the limit of {limit}"
            self.faults.append(Fault(self.place(where), message, f"ask for fewer, or set --limit {count}"))

    def _check_samples(self, plan: Plan) -> None:
        """Check the numbers of runs and seeds."""
        settings, seeds, random = self.settings, plan.seeds, plan.random
        if settings.runs and seeds and len(seeds) != settings.runs:
            self.refuse(
                ("runs",),
                f"{settings.runs} samples for {len(seeds)} seeds: each sample needs its own seed",
                "give only one of them, or the same number of both",
            )
        if random and not settings.runs and not seeds:
            self.refuse(
                ("runs",), "random variables without a number of samples", "give the number, for example --runs 500"
            )
        if settings.runs and not random and not settings.rare:
            self.refuse(
                ("runs",),
                "nothing random varies",
                "leave `runs` out: all listed values are run, and `seeds` gives the number of seeds",
            )
        if settings.sampling == "saltelli" and (settings.correlated or seeds):
            self.refuse(
                ("sampling",),
                "Sobol' sensitivities require independent variables, without seeds",
                "leave out correlations and seeds, or use another sampling",
            )
        if settings.sampling == "saltelli" and (settings.runs or 0) < len(random) + 2:
            self.refuse(
                ("runs",),
                f"Saltelli's design of {len(random)} variables needs groups of {len(random) + 2} runs",
                "give more",
            )

    def _check_rare(self, plan: Plan) -> None:
        settings, seeds, random = self.settings, plan.seeds, plan.random
        if settings.rare and (seeds or not random or len(random) < len(plan.variables)):
            self.refuse(
                ("rare",),
                "methods for rare failures support random variables only",
                "leave out seeds and listed values",
            )
        if settings.rare:
            try:
                margin_of(plan.fails)
            except ExpressionError as error:
                self.refuse(("fails",), str(error), "the method needs the distance of a run from failure")

    def _check_correlations(self, plan: Plan) -> None:
        settings, names = self.settings, [each.name for each in plan.random]
        for each in settings.correlated:
            for name in each.between:
                if name not in names:
                    self.refuse(("correlated",), f"{name!r} is not a random variable", nearest(name, names))
        if settings.correlated and not self.faults:
            try:
                correlation_matrix(names, plan.design.correlations)
            except ValueError as error:
                self.refuse(("correlated",), str(error), "give smaller coefficients")

    def _check_expressions(self) -> None:
        settings = self.settings
        for name in ("fails", "columns"):
            for key, text in {"": getattr(settings, name)}.items() if name == "fails" else settings.columns.items():
                try:
                    parsed(text or "0")
                except ExpressionError as error:
                    self.refuse(
                        (name, key) if key else (name,),
                        str(error),
                        "write an expression, such as factor_of_safety < 1.3",
                    )

    def check_values(self, plan: Plan) -> None:
        """Check the scene's tables with the first, smallest and largest value of each variable."""
        rows = plan.table
        for each in plan.variables:
            values = [row[each.name] for row in rows]
            numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
            picked = (
                {values.index(pick(values)) for pick in (min, max)}
                if numbers
                else {values.index(v) for v in set(values)}
            )
            for k in sorted(picked):
                if self._wrong_tables(plan, rows[k], each.name):
                    return

    def _wrong_tables(self, plan: Plan, row: Mapping[str, Any], name: str) -> bool:
        data = copy.deepcopy(self.data)
        try:
            for change in plan.changes(row)[len(plan.overrides) :]:
                key, _, value = change.partition("=")
                assign(data, path_of(key), tomllib.loads(f"v = {value}")["v"])
        except (OverrideError, ExpressionError) as error:
            self.refuse(("vary", name), str(error), "")
            return True
        _, faults = validate(data, dotted)
        for place, message, way_out in faults:
            self.refuse(("vary", name), f"with {row[name]!r}: {place}: {message}", way_out)
        return bool(faults)

    def check_scenes(self, plan: Plan) -> None:
        """Refuse the sweep, with the faults of the first scene, if none of the first scenes can be built."""
        to_run = plan.settings["measure"] == "run"
        first: SceneError | None = None
        step = max(1, len(plan.table) // _DRAWN)
        for row in plan.table[: _DRAWN * step : step]:
            try:
                load_scene(plan.scene, plan.changes(row), plan.variant, to_run=to_run)
                return
            except SceneError as error:
                first = first or error
        if first is not None:
            raise first


def _map_of(scene: Any) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    """A box around the movable blocks of ``scene``, and its numbers of cells."""
    problem = scene.problem()
    blocks = problem.blocks
    free = ~blocks.fixed[blocks.vertex_block] if not blocks.fixed.all() else blocks.fixed[blocks.vertex_block]
    low, high = blocks.vertices[free].min(axis=0), blocks.vertices[free].max(axis=0)
    size = high - low
    cell = float(max(size)) / _CELLS or 1.0
    across, up = (int(max(1, math.ceil(length / cell - 1e-9))) for length in size)
    x, y = map(float, low)
    return (x, y, float(low[0] + across * cell), float(low[1] + up * cell)), (across, up)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, float):
        return repr(value)
    return str(value)
