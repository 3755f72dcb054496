"""The house's order, read from the source: who may import whom, what stays out of the solvers, what stands at the
top."""

import ast
import shutil
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HOUSE = ROOT / "geomech"

BASE = {"conventions", "reference", "model"}
#: What each part may import of geomech (besides itself). Data flows one way.
MAY_IMPORT = {
    "conventions": BASE,
    "reference": BASE,
    "model": BASE,
    # How kernels are kept between runs: the solvers' own.
    "compiled": {"kernel_folder"},
    "kernel_folder": set(),
    # Objects as files: what checkpoints are made of, and what a reader in another process hands back.
    "plain_data": set(),
    "dda": BASE | {"compiled"},
    "ddm": BASE | {"compiled"},
    "coupling": BASE | {"compiled", "dda", "ddm"},
    "shapes": BASE - {"reference"} | {"plain_data"},
    "scene": BASE - {"reference"} | {"shapes"},
    # Output and pictures take records; they know nothing of how they were solved.
    "output": BASE | {"plain_data", "shapes", "scene"},
    "render": BASE | {"shapes", "scene", "output"},
}
#: The edge, where everything is put together; nothing above imports it.
EDGE = {
    "__init__",
    "__main__",
    "bench",
    "cli",
    "examples",
    "installing",
    "interruption",
    "pipeline",
    "player",
    "repeats",
    "report",
    "resumption",
    "study",
    "sweep",
}

#: Distributions that only these parts import; benchmarks time the writers of others.
ONLY_IN = {
    "gmsh": {"shapes"},
    "ezdxf": {"shapes"},
    "vtk": {"output", "render"},
    "vtkmodules": {"output", "render"},
    "pyvista": {"output", "render", "bench", "report", "player"},
    "matplotlib": {"render"},
    "imageio": {"render"},
    "pydantic": {"scene"},
    "meshio": {"shapes", "output", "bench"},
    "h5py": {"output"},
    "numba": {"compiled", "dda", "ddm", "coupling"},
    "shapely": {"shapes", "scene", "coupling", "output", "render"},
    "distributed": {"sweep", "bench"},
    "pyarrow": {"sweep"},
    "SALib": {"sweep"},
}
#: Heavy ones are imported where they are used, never when a module is.
LAZY = {"gmsh", "ezdxf", "vtk", "vtkmodules", "pyvista", "matplotlib", "scipy", "imageio", "meshio", "h5py", "distributed",
        "pyarrow", "SALib"}  # fmt: skip

SOURCES = sorted(HOUSE.rglob("*.py"))


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax tree of a source file."""
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def part_of(path: Path) -> str:
    """The part of the house that a source file belongs to."""
    return path.relative_to(HOUSE).parts[0].removesuffix(".py")


def is_for_checkers(node: ast.AST) -> bool:
    """``if TYPE_CHECKING:``, which never runs."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def statements(tree: ast.AST, top: bool = True):
    """All (import, whether at module level) below ``tree``; expressions hold none."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node, top
        elif not isinstance(node, ast.expr):
            deeper = isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) or is_for_checkers(node)
            yield from statements(node, top and not deeper)


def imports(path: Path, package: str | None = None, source: str | None = None):
    """All (dotted name, line, at module level) that ``path`` imports, those inside functions too."""
    package = package or ".".join(path.relative_to(ROOT).parts[:-1])
    tree = tree_of(path) if source is None else ast.parse(source, filename=str(path))
    for node, top in statements(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno, top
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, base] if base else above)
            for alias in node.names:
                yield f"{base}.{alias.name}", node.lineno, top


def breaches(path: Path, part: str, found) -> list[str]:
    """What in the imports ``found`` of a file of ``part`` is against the rules."""
    wrong = []
    for name, line, top in found:
        first, *rest = name.split(".")
        where = f"{path}:{line}"
        if first == "geomech":
            other = rest[0] if rest else "__init__"
            if other != "__version__" and part in MAY_IMPORT and other != part and other not in MAY_IMPORT[part]:
                wrong.append(f"{where}: {part} must not import geomech.{other}")
        elif first in ONLY_IN and part not in ONLY_IN[first]:
            wrong.append(f"{where}: {first} is imported outside {', '.join(sorted(ONLY_IN[first]))}")
        elif first in LAZY and top:
            wrong.append(f"{where}: {first} must be imported inside the function that needs it")
    return wrong


def test_imports_keep_to_the_house():
    assert [
        breach for path in SOURCES for breach in breaches(path.relative_to(ROOT), part_of(path), imports(path))
    ] == []


def test_the_reader_of_imports_sees_every_kind():
    """The check above is only as good as its reading: every form of import, against rules it breaks."""
    source = (
        "import gmsh\nfrom ..ddm import Body\nfrom .. import coupling\n"
        "def f():\n    from geomech.output.vtk.series import Series\n    import scipy.linalg\n    from .kinematics import displacement_matrix\n"
    )
    path = HOUSE / "dda" / "imaginary.py"
    found = list(imports(path, source=source))
    assert [name for name, _, _ in found] == [
        "gmsh",
        "geomech.ddm.Body",
        "geomech.coupling",
        "geomech.output.vtk.series.Series",
        "scipy.linalg",
        "geomech.dda.kinematics.displacement_matrix",
    ]
    wrong = breaches(path, "dda", found)
    assert [w.split(": ", 1)[1] for w in wrong] == [
        "gmsh is imported outside shapes",
        "dda must not import geomech.ddm",
        "dda must not import geomech.coupling",
        "dda must not import geomech.output",
    ]
    assert breaches(path, "dda", [("scipy.linalg", 1, True)]) != []


def test_every_part_has_its_place():
    parts = {part_of(path) for path in SOURCES}
    assert parts <= set(MAY_IMPORT) | EDGE, "a new part of the house: say above what it may import"
    assert set(MAY_IMPORT) | EDGE <= parts, "a part that is gone: say no more of it above"


def test_modules_are_named_after_their_idea_and_do_not_print():
    assert {path.stem for path in SOURCES}.isdisjoint({"utils", "util", "helpers", "helper", "common", "misc"})
    assert [
        f"{path.relative_to(ROOT)}:{n.lineno}"
        for path in SOURCES
        if part_of(path) not in EDGE
        for n in ast.walk(tree_of(path))
        if isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id == "print"
    ] == []


ABSENT = """
import importlib.abc, sys
class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {absent!r}:
            raise ImportError(name + " is not here")
sys.meta_path.insert(0, Absent())
import {module}
print(sorted({absent!r} & {{name.split(".")[0] for name in sys.modules}}))
"""


def test_solvers_stand_alone():
    """The solvers import with none of the packages of scenes, drawings and pictures installed."""
    absent = {"pydantic", "shapely", "gmsh", "vtk", "vtkmodules", "pyvista", "matplotlib", "meshio", "imageio"}
    modules = (
        "geomech, geomech.dda, geomech.ddm.fracture.criteria, geomech.ddm.growth.tip_advance, geomech.ddm.propagation"
    )
    code = ABSENT.format(absent=absent, module=modules)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


@pytest.mark.other_machines
def test_top_level_is_as_agreed():
    if shutil.which("git") is None:
        pytest.skip("git, which knows what belongs to the project, is not installed")
    listed = subprocess.run(["git", "ls-files"], capture_output=True, text=True, cwd=ROOT, check=False)
    if listed.returncode or not listed.stdout:
        pytest.skip("not a git checkout")
    files = [Path(line) for line in listed.stdout.splitlines()]
    allowed = {"pyproject.toml", "README.md", "LICENSE", ".gitignore", ".ci"}
    allowed |= {"docs", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff"}
    allowed |= {"geomech", "geometry", "pipelines", "tests", "outputs"}
    assert {f.parts[0] for f in files} <= allowed
    assert not [f for f in files if f.parts[0] == "geometry" and f.suffix == ".py"], "geometry holds data, no Python"


def module_of(path: Path) -> str:
    """The dotted name of a source file of the package."""
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Groups of modules that import each other: strongly connected parts of ``graph`` (Tarjan 1972)."""
    number, lowest, stack, found = {}, {}, [], []

    def visit(module: str) -> None:
        number[module] = lowest[module] = len(number)
        stack.append(module)
        for other in graph[module]:
            if other not in number:
                visit(other)
                lowest[module] = min(lowest[module], lowest[other])
            elif other in stack:
                lowest[module] = min(lowest[module], number[other])
        if lowest[module] == number[module]:
            at = stack.index(module)
            group = set(stack[at:])
            del stack[at:]
            if len(group) > 1 or module in graph[module]:
                found.append(group)

    for module in graph:
        if module not in number:
            visit(module)
    return found


def import_graph(sources) -> dict[str, set[str]]:
    """Which modules of the package each module imports, in functions and for type checkers too."""
    modules = {module_of(path) for path in sources}
    graph = {}
    for path in sources:
        package = ".".join(path.relative_to(ROOT).parts[:-1])
        named = {name for name, _, _ in imports(path, package)}
        graph[module_of(path)] = {
            full if full in modules else full.rsplit(".", 1)[0] for full in named if full.startswith("geomech.")
        } & modules - {module_of(path)}
    return graph


def test_no_modules_import_each_other():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [{"a", "b", "c"}]
    assert circles(import_graph(SOURCES)) == []


def test_no_two_test_files_have_one_name():
    """pytest leaves one of them out."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []


def test_no_folder_holds_more_than_twelve_files():
    counts = {}
    for path in SOURCES:
        counts[path.parent] = counts.get(path.parent, 0) + 1
    assert {str(folder.relative_to(ROOT)): n for folder, n in counts.items() if n > 12} == {}


#: Most arguments of a function, and of one that is compiled.
MOST_ARGUMENTS, MOST_OF_KERNELS = 8, 12
#: Decorators of compiled functions.
COMPILED = {"kept", "part", "allocating", "njit", "jit", "_jit", "_part", "_inlined", "intrinsic"}


def too_many_arguments(path, tree):
    """{path:function: number of arguments} of the functions in ``tree`` that take more than they may."""
    found = {}
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef):
            continue
        given = [arg.arg for arg in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
        count = len([name for name in given if name not in ("self", "cls")])
        decorators = {ast.unparse(each).partition("(")[0] for each in node.decorator_list}
        if count > (MOST_OF_KERNELS if decorators & COMPILED else MOST_ARGUMENTS):
            found[f"{path}:{node.name}"] = count
    return found


def test_functions_take_few_arguments():
    nine, thirteen = (", ".join(f"a{k}" for k in range(n)) for n in (9, 13))
    for text, many in (
        (f"def f({nine}): 0", 9),
        (f"@kept()\ndef f({nine}): 0", None),
        (f"@_part\ndef f({thirteen}): 0", 13),
    ):
        assert too_many_arguments("x", ast.parse(text)) == ({} if many is None else {"x:f": many})
    found = {}
    for path in SOURCES:
        found |= too_many_arguments(path.relative_to(ROOT).as_posix(), tree_of(path))
    assert found == {}


#: Most lines of a function.
MOST_LINES = 80


def too_many_lines(path, tree):
    """{path:function: number of lines} of the functions in ``tree`` that are longer than they may be."""
    functions = [node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    lines = {f"{path}:{node.name}": node.end_lineno - node.lineno + 1 for node in functions}
    return {name: count for name, count in lines.items() if count > MOST_LINES}


def test_functions_are_short():
    assert too_many_lines("x", ast.parse("def f():\n" + "    pass\n" * 80)) == {"x:f": 81}
    found = {}
    for path in SOURCES:
        found |= too_many_lines(path.relative_to(ROOT).as_posix(), tree_of(path))
    assert found == {}
