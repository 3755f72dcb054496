"""Compiled kernels must not lie in the package: what pip does not know of, it leaves behind."""

import ast
import inspect
import math
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import geomech


def cache_of(**environment) -> Path:
    code = "import geomech, numba; print(numba.config.CACHE_DIR)"
    clean = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**clean, **environment}
    )
    return Path(done.stdout.strip())


def test_kernels_are_kept_outside_the_package(tmp_path):
    package = Path(geomech.__file__).resolve().parent
    assert package not in cache_of().resolve().parents
    assert cache_of(XDG_CACHE_HOME=str(tmp_path)) == tmp_path / "geomech" / "kernels"


def test_the_users_own_choice_stands(tmp_path):
    assert cache_of(NUMBA_CACHE_DIR=str(tmp_path)) == tmp_path


def test_a_place_that_cannot_be_written_is_no_fault(tmp_path):
    # Below a file there can be no folder, not even for root.
    (tmp_path / "file").write_text("")
    code = (
        "import numpy as np\n"
        "from geomech.dda.kinematics.simplex_integration import block_moments\n"
        "print(block_moments(np.array([[0, 0], [1, 0], [1, 1.0]]), np.array([1, 2, 0]), np.array([0, 3]))[0, 0])"
    )
    package = Path(geomech.__file__).resolve().parent
    before = set(package.rglob("*.nb[ci]"))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "file" / "kernels")}
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, env=environment)
    # Numba goes back to the folders of the sources.
    for left in set(package.rglob("*.nb[ci]")) - before:
        left.unlink()
    assert (done.returncode, done.stdout.strip()) == (0, "0.5"), done.stderr


def test_an_upgrade_of_what_a_kernel_calls_compiles_it_anew(tmp_path):
    """Numba's own stamp is of the kernel's file only: the old code of what it calls, in another file, would be
    taken."""
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg" / "__init__.py").touch()
    (tmp_path / "pkg" / "above.py").write_text(
        "from geomech.compiled import kept\nfrom .below import shifted\n"
        "@kept(nogil=True)\ndef scaled(x):\n    return 2.0 * shifted(x)\n"
    )
    code = "from pkg.above import scaled\nprint(scaled(1.0), sum(scaled.stats.cache_hits.values()))"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    environment["PYTHONDONTWRITEBYTECODE"] = "1"

    def ran(shift: float) -> str:
        below = f"from numba import njit\n@njit\ndef shifted(x):\n    return x + {shift}\n"
        (tmp_path / "pkg" / "below.py").write_text(below)
        return subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
        ).stdout.strip()

    # A result, and whether it was found compiled.
    assert [ran(1.0), ran(5.0), ran(5.0)] == ["4.0 0", "12.0 0", "12.0 1"]


def test_kernels_that_call_into_other_files_are_stamped_by_those_too():
    import importlib
    import pkgutil

    from numba.core.dispatcher import Dispatcher

    from geomech.compiled import WithCalled, _KernelCompiler, compiled_in

    reaching, kernels, constants = 0, 0, set()
    for package in ("dda", "ddm", "coupling", "model"):
        for module in pkgutil.walk_packages([str(Path(geomech.__file__).parent / package)], f"geomech.{package}."):
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, Dispatcher) and value.__module__ == module.name and value._cache.cache_path:
                    kernels += 1
                    # Else what it calls may be another's code, see below.
                    assert issubclass(value._compiler.pipeline_class, _KernelCompiler), value
                    files, taken = compiled_in(value.py_func)
                    constants |= set(taken)
                    if files - {value.py_func.__code__.co_filename}:
                        reaching += 1
                        assert isinstance(value._cache._impl.locator, WithCalled), value
    assert kernels > 20 and reaching > 5
    # Numbers of other files are a part of the stamp by their value.
    assert "geomech.ddm.kernels.full_plane.WIDTH" in constants


def test_a_kernel_calls_its_own_copies_only(tmp_path):
    """What is open to code of the same name that was loaded earlier is other code in the run that compiles than in all
    later ones. A part that is called from two places stays a function; only Python's way in may be seen from outside."""
    (tmp_path / "parts_of.py").write_text(
        "import numpy as np\nfrom geomech.compiled import kept, part\n"
        "@part(error_model='numpy')\ndef long(x):\n"
        "    for k in range(len(x)):\n"
        + "        x[k] = np.sin(x[k]) * np.cos(x[k]) + np.exp(-x[k]) ** 1.5\n"
        * 12  # too long to be inlined
        + "    return x.sum()\n"
        "@kept(error_model='numpy')\ndef twice(x):\n    return long(x) + long(x)\n"
    )
    code = (
        "import numpy as np, parts_of\n"
        "print(parts_of.twice(np.full(3, 0.5)))\n"
        "cached, = parts_of.twice.overloads.values()\n"
        "print([f.name for f in cached.library.get_defined_functions() if 'linkonce' in f.linkage.name])\n"
        "print(sum('long' in f.name for f in cached.library.get_defined_functions()))\n"
        "try:\n    parts_of.long(np.ones(3))\n"
        "except TypeError as error:\n    print(error)\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    total, open_to_others, own, refused = done.stdout.splitlines()
    x, expected = [0.5] * 3, 0.0
    for _ in range(2):
        for _ in range(12):
            x = [math.sin(v) * math.cos(v) + math.exp(-v) ** 1.5 for v in x]
        expected += sum(x)
    assert float(total) == pytest.approx(expected, rel=1e-14)
    assert open_to_others == "[]" and int(own) == 1
    assert "kernels" in refused
    assert [file.name.split("-")[0] for file in (tmp_path / "kernels").rglob("*.nbi")] == ["parts_of.twice"]


@pytest.mark.slow
def test_the_run_that_compiles_gives_the_same_bits_as_later_ones(tmp_path):
    """Influence of two cracks on each other: its kernel calls parts whose products may be fused with sums."""
    code = (
        "import numpy as np\n"
        "from geomech import ddm\n"
        "from geomech.model import Cracks, Material\n"
        "lines = [np.array([[0.0, 0.0], [1e-2, 3e-3]]), np.array([[2e-3, 4e-3], [9e-3, 1e-2]])]\n"
        "body = ddm.Body([], Cracks.from_polylines(lines), Material('rock', 17e9, 0.21, k_ic=2e6))\n"
        "solution = body.solve(ddm.BodyLoad(remote_stress=np.array([1e6, 2e6, 5e5])))\n"
        "print(solution.tips.tobytes().hex(), solution.stress(np.array([[1e-2, 2e-2], [4e-3, 3e-3]])).tobytes().hex())"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True).stdout
        for _ in range(3)
    ]
    assert runs[0] == runs[1] == runs[2]


#: What functions without reference counting may call besides such functions: none of it allocates or returns an array
#: of its own. Types derived from tuples may be made, and functions of LLVM and of libraries called.
ALLOCATES_NOTHING = {
    "range", "len", "min", "max", "abs", "round", "int", "float", "bool", "complex", "zip", "enumerate", ".sum",
    *(f"{module}.{name}" for module in ("np", "math") for name in (
        "sqrt", "hypot", "cos", "sin", "atan2", "arctan2", "log", "log1p", "exp", "abs", "sign", "copysign", "isnan",
        "isfinite", "floor", "ceil", "int64", "float64", "searchsorted")),
}  # fmt: skip


def compiled_functions():
    """All kernels and parts."""
    import importlib
    import pkgutil

    from numba.core.dispatcher import Dispatcher

    for package in ("dda", "ddm", "coupling", "model"):
        for module in pkgutil.walk_packages([str(Path(geomech.__file__).parent / package)], f"geomech.{package}."):
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, Dispatcher) and value.__module__ == module.name:
                    yield value


def calls_of(function):
    """What a compiled ``function`` calls: other compiled functions, and the names of everything else that could
    allocate."""
    from numba.core.dispatcher import Dispatcher
    from numba.core.types import ExternalFunction, Type
    from numba.extending import _Intrinsic

    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(function.py_func))).body
    called, names = [], set()
    for node in (each for statement in tree.body for each in ast.walk(statement)):
        if isinstance(node, (ast.ListComp, ast.SetComp, ast.DictComp, ast.List, ast.Set, ast.Dict)):
            names.add(type(node).__name__)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            value = function.py_func.__globals__.get(node.func.id)
            if isinstance(value, Dispatcher):
                called.append(value)
            elif not (
                isinstance(value, (_Intrinsic, ExternalFunction, Type))
                or (isinstance(value, type) and issubclass(value, tuple))
            ):
                names.add(node.func.id)
        elif isinstance(node, ast.Call):
            of_module = isinstance(node.func.value, ast.Name) and node.func.value.id in ("np", "math")
            names.add(ast.unparse(node.func) if of_module else f".{node.func.attr}")
    return called, names


def test_references_are_counted_where_arrays_are_allocated_and_only_there():
    """Without counting, arrays that a function allocates would never be released; with it, code of functions that only
    fill arrays takes longer to compile and to run. (That none returns an array is tested as it is compiled.)"""
    from geomech.compiled import UNCOUNTED

    calls = {function: calls_of(function) for function in compiled_functions()}

    def allocates(function) -> bool:
        called, names = calls[function]
        return bool(names - ALLOCATES_NOTHING) or any(allocates(each) for each in called)

    assert UNCOUNTED == {"_nrt": False} and len(calls) > 200
    counted = {function for function in calls if function.targetoptions.get("_nrt", True)}
    assert 40 < len(counted) < 100
    assert {each.__qualname__ for each in counted} == {each.__qualname__ for each in calls if allocates(each)}


def test_what_only_kernels_call_is_no_kernel_by_itself():
    """A kernel that a kernel calls is compiled to machine code of its own, with a way in for Python: in vain, unless
    Python calls it."""
    from geomech.compiled import _KernelCompiler, _PartCompiler

    functions = list(compiled_functions())
    compiled = {(each.__module__, each.__name__) for each in functions}
    by_python: set[str] = set()

    def look(node, module):
        if not (isinstance(node, ast.FunctionDef) and (module, node.name) in compiled):
            by_python.update(getattr(node, key) for key in ("id", "attr") if hasattr(node, key))
            for inner in ast.iter_child_nodes(node):
                look(inner, module)

    root = Path(geomech.__file__).parent
    for file in (each for package in ("dda", "ddm", "coupling", "model") for each in (root / package).rglob("*.py")):
        look(ast.parse(file.read_text()), ".".join(("geomech", *file.relative_to(root).with_suffix("").parts)))
    kernels = [each for each in functions if issubclass(each._compiler.pipeline_class, _KernelCompiler)]
    kernels = [each for each in kernels if not issubclass(each._compiler.pipeline_class, _PartCompiler)]
    assert len(kernels) > 60
    assert {each.__name__ for each in kernels} <= by_python


def test_a_function_without_reference_counting_returns_no_array(tmp_path):
    (tmp_path / "rows.py").write_text(
        "from geomech.compiled import UNCOUNTED, kept, part\n"
        "@part(nogil=True, **UNCOUNTED)\ndef same(x):\n    return x\n"
        "@kept(nogil=True, **UNCOUNTED)\ndef total(x):\n    return same(x).sum()\n"
        "@kept(nogil=True, **UNCOUNTED)\ndef pair(x):\n    return x[0, 0], (1.0, x[1])\n"
    )
    code = (
        "import numpy as np, rows\n"
        "for function in rows.total, rows.pair:\n"
        "    try:\n        function(np.ones((2, 3)))\n"
        "    except TypeError as error:\n        print(error)\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.splitlines() == [
        f"{name} returns arrays, so it cannot be UNCOUNTED" for name in ("same", "pair")
    ]


@pytest.mark.slow
def test_the_level_of_optimisation_before_linking_changes_no_bit(tmp_path):
    """A part of products, quotients, sums and elementary functions, and a kernel that calls it: as compiled here, and
    with LLVM's passes before linking as Numba makes them."""
    body = "".join(
        f"    for i in range(len(x)):\n        y = x[i] * {k}.7 + y * x[i - 1] / (1.0 + x[i] ** 2) + np.sin(y) ** 3 * 0.1\n"
        for k in range(4)
    )
    (tmp_path / "levels.py").write_text(
        "import numpy as np\nfrom geomech.compiled import UNCOUNTED, kept, part\n"
        f"@part(fastmath=False, error_model='numpy', **UNCOUNTED)\ndef chain(x, y):\n{body}    return y\n"
        "@kept(fastmath=False, error_model='numpy')\ndef chained(x):\n    out = np.empty_like(x)\n"
        "    for i in range(len(x)):\n        out[i] = chain(x[: i + 1], 0.1) * x[i] + chain(x, x[i])\n    return out\n"
    )
    code = (
        "import sys, numpy as np\nfrom geomech import compiled\n"
        "numbers = np.random.default_rng(1).normal(size=40)\n"
        "levels, passes = [], compiled.CPUCodegen._function_pass_manager\n"
        "def noted(self, **options):\n    levels.append(options)\n"
        "    return passes(self, **({} if sys.argv[1:] else options))\n"
        "compiled.CPUCodegen._function_pass_manager = noted\n"
        "import levels as made\nprint(made.chained(numbers).tobytes().hex(), {'opt': 1} in levels)"
    )
    ours, numbas = (
        subprocess.run(
            [sys.executable, "-c", code, *given], capture_output=True, text=True, check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / f"kernels{len(given)}"), "PYTHONPATH": os.pathsep.join(
                [str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])},
        ).stdout
        for given in ([], ["as Numba does"])
    )  # fmt: skip
    assert ours == numbas and ours.split()[1] == "True"


@pytest.mark.parametrize(
    ("made", "level"),
    [
        (lambda builder, x, y: builder.fmul(x, y), {"opt": 1}),
        (lambda builder, x, y: builder.fma(x, y, y), {"opt": 1}),
        (lambda builder, x, y: builder.fmul(x, y, flags=("contract",)), {}),
        (lambda builder, x, y: builder.fneg(x, flags=("reassoc", "nsz")), {}),
        (lambda builder, x, y: builder.call(builder.function, [x, y], fastmath=("fast",)), {}),
        (lambda builder, x, y: builder.select(builder.fcmp_ordered("<", x, y, flags=("nnan",)), x, y), {}),
    ],
)
def test_what_may_be_fused_is_optimised_before_linking_as_numba_does(monkeypatch, made, level):
    """Flags of fast mathematics can stand in functions that ask for none: those of `ddm.kernels.simd` make them."""
    from llvmlite import ir
    from numba.core.registry import cpu_target

    from geomech.compiled import CPUCodegen, _Part

    levels, passes = [], CPUCodegen._function_pass_manager
    monkeypatch.setattr(
        CPUCodegen, "_function_pass_manager", lambda self, **of: (levels.append(of), passes(self, **of))[1]
    )
    codegen, number = cpu_target.target_context.codegen(), ir.DoubleType()
    module = codegen._create_empty_module("made")
    function = ir.Function(module, ir.FunctionType(number, [number, number]), "made")
    builder = ir.IRBuilder(function.append_basic_block())
    builder.ret(made(builder, *function.args))
    levels.clear()
    _Part(codegen, "made").add_ir_module(module)
    assert levels == [level]


def test_sizes_are_those_of_numba_and_new_declarations_are_found(monkeypatch):
    from llvmlite import ir
    from numba.core import imputils
    from numba.core.registry import cpu_target

    from geomech import compiled

    context, number = cpu_target.target_context, ir.DoubleType()
    named = ir.global_context.get_identified_type("named")
    named.set_body(number, number)
    pair = ir.LiteralStructType([ir.IntType(8), ir.ArrayType(number, 3)])
    for of in number, pair, pair.as_pointer(), ir.LiteralStructType([pair, named]), ir.IntType(1), pair:
        assert compiled._remembered_size(context, of) == context.get_abi_sizeof(of)
    context.refresh()
    refreshed = []
    monkeypatch.setattr(compiled, "_refresh", refreshed.append)
    compiled._loaded.clear()
    compiled._refresh_if_new(context)
    compiled._refresh_if_new(context)
    assert refreshed == [context]
    monkeypatch.setattr(imputils.builtin_registry, "casts", [*imputils.builtin_registry.casts, None])
    compiled._refresh_if_new(context)
    assert refreshed == [context, context]
    compiled._loaded.clear()


def test_the_same_references_are_counted_with_less_code():
    from llvmlite import ir
    from numba import types
    from numba.core.registry import cpu_target

    from geomech.compiled import NRTContext, _counted_in

    # Its own context: the one of the process keeps the first `nrt` made of it, which counts nothing.
    context, array = cpu_target.target_context.subtarget(enable_nrt=True), types.Array(types.float64, 2, "C")
    codes = []
    for given in array, types.Tuple((types.int64, array, types.UniTuple(array, 2))), types.Optional(array), types.int8:
        counted = []
        for of in NRTContext.get_meminfos, _counted_in:
            module = context.codegen()._create_empty_module("counted")
            function = ir.Function(module, ir.FunctionType(ir.VoidType(), [context.get_value_type(given)]), "counted")
            builder = ir.IRBuilder(function.append_basic_block())
            counted.append([(ty, str(of.type)) for ty, of in of(context.nrt, builder, given, function.args[0])])
            codes.append(len(builder.block.instructions))
        assert counted[0] == counted[1]
    assert codes[::2] > codes[1::2] and codes[:2] == [11, 1]


def test_variables_live_as_long_as_numba_lets_them():
    from numba.core.compiler import run_frontend
    from numba.core.postproc import PostProcessor

    from geomech.compiled import _without_entry_variables

    def branching(x, n):
        total, last = 0.0, x[0]
        for i in range(n):
            if x[i] > last:
                total += x[i]
            else:
                last = x[i]
                continue
            total -= last
        return total

    def yielding(n):
        for i in range(n):
            yield i * i

    for function in branching, yielding:
        ours, numbas = run_frontend(function), run_frontend(function)
        _without_entry_variables(PostProcessor(ours), emit_dels=True)
        PostProcessor(numbas).run(emit_dels=True)
        assert ours.dump_to_string() == numbas.dump_to_string() and "del " in ours.dump_to_string()
        assert (ours.generator_info is None) == (numbas.generator_info is None)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(
    ("owner", "name"),
    [
        ("numba.core.codegen:CPUCodeLibrary", "_get_module_for_linking"),
        ("numba.core.caching", "IndexDataCacheFile"),
        ("numba.core.config", "CACHE_LOCATOR_CLASSES"),
    ],
)
def test_a_numba_whose_inner_parts_have_moved_is_used_its_own_way(tmp_path, owner, name):
    """What is relied on of it is no promise of Numba's; without it, kernels are right and a warning says so."""
    (tmp_path / "summing.py").write_text(
        "from geomech.compiled import kept, part\n"
        "@part(error_model='numpy')\ndef twice(x):\n    return 2.0 * x\n"
        "@kept(error_model='numpy')\ndef summed(x):\n    return twice(x[0]) + twice(x[1])\n"
    )
    module, _, inner = owner.partition(":")
    code = (
        f"import numba, {module}\nowner = {module}{'.' if inner else ''}{inner}\n"
        # Gone while geomech looks for it alone: Numba itself needs it.
        f"there = owner.{name}; del owner.{name}\nimport geomech.compiled\nowner.{name} = there\n"
        "import numpy as np, summing\nprint(summing.summed(np.array([1.0, 2.0])))"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert done.stdout.strip() == "6.0", done.stderr
    assert "kernels are stored in Numba's own cache" in done.stderr


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("fault", ["o._dump = lambda self, data, protocol: dump(self, data)\n", ""])
def test_a_newer_numba_is_tried_before_it_is_relied_on(tmp_path, fault):
    """An inner part of the same name that is called in another way; and a newer version where nothing has moved."""
    (tmp_path / "summing.py").write_text(
        "from geomech.compiled import kept\n@kept(error_model='numpy')\ndef summed(x):\n    return x[0] + x[1]\n"
    )
    code = (
        "import logging, sys, numba, numpy as np\nfrom numba.core.caching import IndexDataCacheFile as o\n"
        "numba.__version__ = '9.1.0'\ndump = o._dump\n"
        f"{fault}"
        "from geomech import compiled\nfrom geomech.cli.messages import report_compiling\nreport_compiling()\n"
        "o._dump = dump\nimport summing\nprint(summing.summed(np.array([1.0, 2.0])), compiled.OWN_WAY)"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert done.stdout.split() == ["3.0", str(not fault)], done.stderr
    assert ("Numba 9.1.0 is unknown (TypeError" in done.stderr) == bool(fault)
    assert "compiling kernels, once" in done.stderr
    (stored,) = (tmp_path / "kernels").rglob("summing.summed*.nbc")
    assert ("of_numba_" in str(stored)) == bool(fault)


def test_a_part_is_compiled_once_for_all_constants(tmp_path):
    """Numba compiles what is called with 0, with 1 and with n three times; Numba's own inference is back afterwards."""
    (tmp_path / "constants.py").write_text(
        "from geomech.compiled import kept, part\n"
        "@part(nogil=True)\ndef shifted(x, n):\n    return x + n\n"
        "@kept(nogil=True)\ndef scaled(x, n):\n    return shifted(x, 0) + shifted(x, 1) + shifted(x, n)\n"
    )
    code = (
        "from geomech import compiled as c\n"
        "def inner():\n    return [getattr(owner, name) for owner, names in c._INNER for name in names]\n"
        "before = inner()\n"
        "from constants import scaled, shifted\n"
        "print(scaled(1.0, 5), len(shifted.overloads), inner() == before)\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.split() == ["9.0", "1", "True"]


def test_functions_of_numba_are_compiled_with_the_kernels_that_call_them(tmp_path):
    """One machine code for a kernel, its part and the arrays that both make; errors of those reach Python, from the
    kernel, from the kernel found compiled and from another package's function, which is Numba's own affair."""
    (tmp_path / "rooms.py").write_text(
        "import numpy as np\n"
        "from geomech.compiled import kept, part\n"
        "@part(fastmath=False, nogil=True)\ndef room(n):\n    return np.zeros(n)\n"
        "@kept(fastmath=False, nogil=True)\ndef filled(n):\n    return len(room(n)) + len(np.zeros(n)) + max(n, 1)\n"
    )
    code = (
        "import gc\nfrom numba import njit\nfrom numba.core import codegen\nimport numpy as np\nimport rooms\n"
        "compiled, optimise = [], codegen.CPUCodeLibrary._optimize_final_module\n"
        "def counted(library):\n    compiled.append(library.name)\n    optimise(library)\n"
        "codegen.CPUCodeLibrary._optimize_final_module = counted\n"
        "@njit\ndef own(n):\n    return len(np.zeros(n)) + max(n, 1)\n"
        "print(rooms.filled(3), compiled.count('filled'), sum('impl' in each for each in compiled), own(3), gc.isenabled())\n"
        "for function in rooms.filled, own:\n"
        "    try:\n        function(-1)\n    except ValueError as error:\n        print(error)\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(Path(geomech.__file__).resolve().parents[1])])
    first, later = (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        .stdout.splitlines()
        for _ in range(2)
    )  # fmt: skip
    assert first == ["9 1 0 6 True", "negative dimensions not allowed", "negative dimensions not allowed"]
    assert later == ["9 0 0 6 True", *first[1:]]


def test_variables_of_statements_are_those_of_numba_in_its_order():
    from numba.core import ir

    from geomech.compiled import _variables_of

    place = ir.Loc("here", 1)
    a, b, c, d = (ir.Var(None, name, place) for name in "abcd")
    called = ir.Expr.call(a, [b, (c, [d])], [("of", b)], place, vararg=c)
    made = ir.Expr.build_map([(a, b), (c, d)], 2, {}, {}, place)
    for statement in ir.Assign(called, d, place), ir.Assign(made, a, place), ir.Return(b, place), ir.Del("a", place):
        assert _variables_of(statement, vars(statement)) == ir.Inst._rec_list_vars(statement, vars(statement))
    assert [each.name for each in _variables_of(called, called._kws)] == ["a", "b", "c", "d", "b", "c"]


def test_passes_of_numba_run_where_there_is_something_for_them(monkeypatch):
    """Closures, reductions and comprehensions are inlined, and expressions of whole arrays rewritten; a function without
    any of these is spared the search."""
    from functools import reduce

    import numpy as np
    from numba import njit

    from geomech import compiled

    ran = []
    for name in ("_inline", "_rewrite"):
        original = getattr(compiled, name)
        monkeypatch.setattr(compiled, name, lambda *given, n=name, of=original: ran.append(n) or of(*given))

    def loop(x):
        total = 0.0
        for i in range(len(x)):
            total += x[i] if x[i] > 1.0 else 2.0 * x[i]
        return total

    def closure(x):
        def twice(y):
            return 2.0 * y

        return twice(x[0])

    def comprehension(x):
        return np.array([2.0 * each for each in x]).sum()

    def reduction(x):
        return reduce(lambda a, b: a + b, x)

    def arrays(x):
        return (2.0 * x - x / 3.0).sum()

    def constants(x):
        return np.array([1.0, 2.0]).sum() + x[0]

    x = np.array([0.5, 1.5])
    for function, passes in (
        (loop, set()), (closure, {"_inline"}), (comprehension, {"_inline"}), (reduction, {"_inline"}),
        (arrays, {"_rewrite"}), (constants, {"_inline", "_rewrite"}),
    ):  # fmt: skip
        ran.clear()
        made = njit(pipeline_class=compiled._KernelCompiler)(function)
        assert made(x) == pytest.approx(function(x), rel=1e-15)
        assert passes <= set(ran), function
        assert passes or not ran


def test_settings_are_equal_where_numba_says_so():
    from numba.core.compiler import Flags

    from geomech.compiled import _same_settings

    plain, default, other = Flags(), Flags(), Flags()
    default.nrt, other.nrt = Flags.options["nrt"].default, not Flags.options["nrt"].default
    for one, two in (plain, default), (plain, other), (default, other), (other, other.copy()):
        assert _same_settings(one, two) == (one.values() == two.values())
    assert _same_settings(plain, 1) is NotImplemented


@pytest.mark.skipif(sys.platform != "linux", reason="page faults of Linux")
def test_calls_of_the_compiler_take_no_memory_from_the_system_however_deep_they_begin():
    """Somewhere in the depths a chunk of CPython's frames ends; calls across that end are page faults each."""
    import resource

    from geomech.compiled import _with_room

    def leaf():
        return 1

    def often(depth):
        if depth:
            return often(depth - 1)
        return sum(leaf() for _ in range(100)) + sum(map(lambda _: leaf(), range(100)))

    def faults() -> int:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for depth in range(200):
            often(depth)
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    _with_room(faults)
    # 324 without the room, and some for the memory of numbers.
    assert _with_room(faults) < 100
