"""Kernels that are kept between runs, each with all that it calls.

Numba keeps compiled code with a digest of the one file that a kernel stands in. What the kernel calls is part of its
code, so that after an upgrade in which only that has changed the old code would be taken: here the digest is of that
too.

Numba leaves the copies of what a kernel calls open to whoever loads code of the same name earlier. In the run that
compiles that is what was called, compiled by itself; in runs that find the kernel compiled it is the kernel's own copy,
which was optimised with it and fuses other products with sums: other last digits. Here they are the kernel's alone, and
what only kernels call (`part`) is made machine code nowhere else.

Most of the time of compiling goes into Numba's inference of types. While kernels are compiled it remembers what
operators and functions give for arguments of given types, and compares its own settings by what is set in them; a
`part` is compiled once for all integers that are passed to it, not once for each constant.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import logging
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType

import numpy as np
from llvmlite import binding as llvm
from numba import __version__ as numba_version
from numba import config, jit, njit, types

from .kernel_folder import SOURCE, kernel_place, prune

log = logging.getLogger(__name__)

try:
    from numba.core.caching import IndexDataCacheFile, UserProvidedCacheLocator
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import Compiler
    from numba.core.dispatcher import Dispatcher
    from numba.core.options import DefaultOptions
    from numba.core.targetconfig import ConfigStack, TargetConfig
    from numba.core.types.functions import BaseFunction
    from numba.core.typing.templates import _OverloadFunctionTemplate
except ImportError:  # reported below
    IndexDataCacheFile = UserProvidedCacheLocator = JITCodeLibrary = Compiler = object
    ConfigStack = TargetConfig = BaseFunction = DefaultOptions = _OverloadFunctionTemplate = object
    Dispatcher = type(njit(lambda: None))

#: What of Numba's inner parts is relied on; they may move in any version.
_INNER = (
    (JITCodeLibrary, ("_finalize_final_module", "_finalize_dynamic_globals", "_get_module_for_linking",
                      "_optimize_functions", "_raise_if_finalized")),
    (IndexDataCacheFile, ("_load_index", "_load_data", "_save_data", "_dump", "_data_path",
                          "_open_for_write", "load", "save")),
    (Compiler, ("compile_extra",)),
    (UserProvidedCacheLocator, ("from_function", "ensure_cache_path", "get_cache_path")),
    (Dispatcher, ("_insert", "_compile_for_args", "get_call_template")),
    (BaseFunction, ("get_call_type",)),
    (_OverloadFunctionTemplate, ("_get_impl", "_get_jit_decorator")),
    (ConfigStack, ("top_or_none", "enter")),
    (TargetConfig, ("copy", "values", "options", "__hash__")),
    (config, ("CACHE_LOCATOR_CLASSES", "CACHE_DIR")),
)  # fmt: skip


def moved() -> list[str]:
    """What of `_INNER` this Numba has not got."""
    return [f"{owner.__name__}.{name}" for owner, names in _INNER for name in names if not hasattr(owner, name)]


#: Whether kernels are compiled and kept our way; else by Numba's own, whose last digits may differ between the run that
#: compiles and later ones, and which does not see that a file has changed that a kernel calls into.
OWN_WAY = not moved()
if not OWN_WAY:
    log.warning("Numba %s has not got %s: kernels are kept in its own way", numba_version, ", ".join(moved()))
if kernel_place().instead_of is not None:
    log.warning(
        "%s cannot be written: compiled kernels are kept in %s (NUMBA_CACHE_DIR names another folder)",
        kernel_place().instead_of, kernel_place().folder,
    )  # fmt: skip


#: Further options of `kept` and `part` for kernels that make no arrays and call none that do: Numba then does not count
#: who holds an array, which in loops that hand arrays to many small functions takes most of the time.
UNCOUNTED = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}


def kept(**options) -> Callable:
    """``njit(cache=True, **options)`` for a kernel that Python calls: its compiled code goes with the sources of all
    that it calls within its package, and calls nothing that is compiled elsewhere."""

    def compiled(function: Callable) -> Dispatcher:
        if not OWN_WAY:
            return njit(cache=True, **options)(function)
        # Only while this one is declared: other packages' kernels are theirs.
        before = config.CACHE_LOCATOR_CLASSES, config.CACHE_DIR
        config.CACHE_LOCATOR_CLASSES, config.CACHE_DIR = f"{__name__}.WithCalled", kernel_place().folder
        try:
            made = njit(cache=True, no_cfunc_wrapper=True, pipeline_class=_KernelCompiler, **options)(function)
        finally:
            config.CACHE_LOCATOR_CLASSES, config.CACHE_DIR = before
        if isinstance(made, Dispatcher):  # not where compiling is switched off
            file = made._cache._cache_file
            file.__class__ = _CacheFile
            # Not the name that Numba itself gives: what stands there has no sums.
            file._index_path = str(Path(file._index_path).with_suffix(".summed.nbi"))
        return made

    return compiled


def part(**options) -> Callable:
    """``njit(**options)`` for what kernels alone call: it is compiled with them."""

    def compiled(function: Callable) -> Dispatcher:
        if not OWN_WAY:
            return njit(**options)(function)
        made = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler, **options)(function)
        # Python cannot call it, and is refused with a message; nothing is stored where a call would look for it.
        made._insert = lambda *signature, **how: None
        made._compile_for_args = functools.partial(_refuse, function.__qualname__)
        made.get_call_template = functools.partial(_with_any_integer, made.get_call_template)
        return made

    return compiled


def _refuse(name: str, *args, **kwargs) -> None:
    raise TypeError(f"{name} is part of kernels, which alone can call it")


def _with_any_integer(get_call_template: Callable, args: tuple, kws: dict) -> tuple:
    """The call of a part with the types ``args`` and ``kws``, constants taken as integers of any value."""
    return get_call_template(
        tuple(_plain(each) for each in args), {name: _plain(each) for name, each in kws.items()}
    )  # fmt: skip


def _plain(given: types.Type) -> types.Type:
    constant = isinstance(given, (types.IntegerLiteral, types.BooleanLiteral))
    return types.unliteral(given) if constant else given


#: Types of arguments for which a function always has the same signature, whatever their values.
_PLAIN = (types.Number, types.Boolean, types.Array, types.UniTuple, types.Record)


@contextlib.contextmanager
def _quick_inference() -> Iterator[None]:
    """Numba's inference of types, with `_remembered_call_type` and `_same_settings`, and its own again afterwards."""
    replaced = (
        (BaseFunction, "get_call_type", _remembered_call_type),
        (_OverloadFunctionTemplate, "_get_impl", _implementation_for_kernels),
        (_OverloadFunctionTemplate, "_get_jit_decorator", _as_a_part),
        (TargetConfig, "__eq__", _same_settings),
        (TargetConfig, "__hash__", _hash_of_settings),
    )
    before, collects = [(owner, name, getattr(owner, name)) for owner, name, _ in replaced], gc.isenabled()
    # What a compiler makes is in use until it is done: looking for what is not takes a twentieth of its time.
    gc.disable()
    try:
        for owner, name, ours in replaced:
            setattr(owner, name, ours)
        yield
    finally:
        for owner, name, theirs in before:
            setattr(owner, name, theirs)
        if collects:
            gc.enable()


_call_type = getattr(BaseFunction, "get_call_type", None)
_signatures: dict[tuple, list[tuple]] = {}


def _remembered_call_type(self: BaseFunction, context, args: tuple, kws: dict):
    """The signature of a call of ``self``, found once for the same types and settings: Numba tries all that are
    declared, in each of several rounds of inference."""
    if type(self) is not types.Function or kws or not all(isinstance(each, _PLAIN) for each in args):
        return _call_type(self, context, args, kws)
    settings = _settings_for_kernels()
    known = _signatures.setdefault((self, context, tuple(args)), [])
    for of, signature in known:
        if of is settings or of == settings:
            return signature
    signature = _call_type(self, context, args, kws)
    known.append((settings, signature))
    return signature


def _settings_for_kernels() -> TargetConfig:
    """The present settings without those that make no difference to what a kernel or a part calls; of other packages'
    functions none are the same."""
    settings = ConfigStack.top_or_none().copy()
    settings.no_cpython_wrapper = settings.no_cfunc_wrapper = settings.release_gil = True
    return settings


_implementation = getattr(_OverloadFunctionTemplate, "_get_impl", None)


def _implementation_for_kernels(self: _OverloadFunctionTemplate, args: tuple, kws: dict):
    """What a function of Numba's own is made of for these types of arguments: found once for all kernels."""
    with ConfigStack().enter(_settings_for_kernels()):
        return _implementation(self, args, kws)


def _as_a_part(self: _OverloadFunctionTemplate) -> Callable:
    """Functions of Numba's own are compiled with the kernels that call them, as a `part`, and by themselves not at all."""
    return functools.partial(jit, no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler)


def _same_settings(self: TargetConfig, other: object) -> bool:
    """Whether two sets of settings are the same; most are by what has been set in them."""
    if not isinstance(other, TargetConfig):
        return NotImplemented
    return self is other or self._values == other._values or self.values() == other.values()


@functools.cache
def _hash_of(options: tuple[str, ...]) -> int:
    return hash(tuple(sorted(options)))


def _hash_of_settings(self: TargetConfig) -> int:
    """What Numba's own gives, which is of the names of settings alone."""
    return _hash_of(tuple(self.options))


class _Kernel(JITCodeLibrary):
    """Machine code that calls its own copies of what it was linked with."""

    def _optimize_functions(self, module: llvm.ModuleRef) -> None:
        _optimize_defined(self, module)

    def _finalize_final_module(self) -> None:
        # What other kernels are linked with stays as it was: they must find one copy, not one by each way to it.
        self._shared_module = _for_linking(self._final_module)
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()
        here = {variable.name for variable in self._final_module.global_variables}
        for name, environment in _environments(self).items():
            if name in here:
                self._codegen.set_env(name, environment)


class _Part(JITCodeLibrary):
    """Code to be linked with, of which no machine code is made."""

    @property
    def codegen(self) -> _Part:
        return self

    def set_env(self, name: str, environment) -> None:
        """What the code takes from Python; passed on to the kernel that is linked with it."""
        self.environment = name, environment

    def _optimize_functions(self, module: llvm.ModuleRef) -> None:
        _optimize_defined(self, module)

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._shared_module = _for_linking(self._final_module)
        self._finalized = True


def _optimize_defined(library: JITCodeLibrary, module: llvm.ModuleRef) -> None:
    """As `CPUCodeLibrary._optimize_functions`, without making passes for functions that are only declared."""
    module.data_layout = library._codegen._data_layout
    for function in module.functions:
        if not function.is_declaration:
            passes, builder = library._codegen._function_pass_manager()
            passes.run(function, builder)


def _for_linking(module: llvm.ModuleRef) -> llvm.ModuleRef:
    """A copy of which others take what they need, as `CPUCodeLibrary._get_module_for_linking` makes it."""
    shared = module.clone()
    for function in shared.functions:
        if not function.is_declaration and function.linkage == llvm.Linkage.external:
            function.linkage = "linkonce_odr"
    return shared


def _environments(library: JITCodeLibrary) -> dict:
    """Those of the parts that a ``library`` was linked with, by name."""
    found = {}
    for linked in library._linking_libraries:
        found |= _environments(linked)
        if isinstance(linked, _Part):
            found |= [linked.environment]
    return found


class _KernelCompiler(Compiler):
    """Numba's own, into a `_Kernel`."""

    library = _Kernel
    message = "compiling %s"

    def compile_extra(self, function: Callable):
        if self.message:
            log.debug(self.message, function.__qualname__)
        if self.state.library is None:
            self.state.library = self.library(self.state.targetctx.codegen(), function.__qualname__)
            self.state.library.enable_object_caching()
        with _quick_inference():
            return super().compile_extra(function)


class _PartCompiler(_KernelCompiler):
    """Numba's own, into a `_Part`."""

    library = _Part
    message = ""


class _CacheFile(IndexDataCacheFile):
    """Numba's own, with a sum of what is kept: what is damaged is compiled again, and what cannot be kept is not."""

    def _load_index(self) -> dict:
        try:
            return super()._load_index()
        except Exception as error:
            self._drop(Path(self._index_path), error)
            return {}

    def load(self, key):
        try:
            return super().load(key)
        except Exception as error:
            self._drop(Path(self._data_path(self._load_index()[key])), error)
            return None

    def save(self, key, data) -> None:
        try:
            super().save(key, data)
        except OSError as error:
            log.warning("a compiled kernel cannot be kept in %s: %s", self._cache_path, error.strerror or error)

    def _load_data(self, name: str):
        stored = Path(self._data_path(name)).read_bytes()
        if zlib.crc32(stored[:-4]).to_bytes(4, "little") != stored[-4:]:
            raise ValueError("its sum is another")
        return super()._load_data(name)

    def _save_data(self, name: str, data) -> None:
        stored = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            # The sum stands behind what unpickling reads.
            file.write(stored + zlib.crc32(stored).to_bytes(4, "little"))

    def _drop(self, path: Path, error: Exception) -> None:
        log.warning("%s is damaged (%s): compiled again", path, error)
        path.unlink(missing_ok=True)


class WithCalled(UserProvidedCacheLocator):
    """The user's folder of kernels; a kernel's stamp is of its own file, of those that it calls into, and of the
    constants that it takes from anywhere."""

    def __init__(self, function: Callable, file: str) -> None:
        super().__init__(function, file)
        self._function, self._file = function, file

    def ensure_cache_path(self) -> None:
        """Make it, with a note of the sources that its kernels are of; other kernels whose sources are gone, go."""
        try:
            super().ensure_cache_path()
            noted = Path(self.get_cache_path()) / SOURCE
            if not noted.exists():
                noted.write_text(str(Path(self._file).absolute()), encoding="utf-8")
            _prune_once(noted.parent.parent)
        except OSError as error:
            log.debug("%s: %s", self.get_cache_path(), error)  # reported when a kernel cannot be kept there

    def get_source_stamp(self) -> str:
        files, constants = compiled_in(self._function)
        parts = [_digest(Path(file)) for file in sorted({self._file, *files})]
        return hashlib.sha256(b"".join(parts) + repr(sorted(constants.items())).encode()).hexdigest()


def compiled_in(function: Callable) -> tuple[set[str], dict[str, object]]:
    """What ``function``'s compiled code is made of: the files of its package in which what it calls is defined, and so
    on down, and the numbers and arrays that it and they take by name (module.name → value, or an array's bytes)."""
    package, files, constants, seen, rest = function.__module__.partition(".")[0], set(), {}, set(), [function]
    while rest:
        this = rest.pop()
        if this in seen:
            continue
        seen.add(this)
        for name in _names(this.__code__):
            value = this.__globals__.get(name)
            value = value.py_func if isinstance(value, Dispatcher) else value
            module = getattr(value, "__module__", None) or ""
            if isinstance(value, (bool, int, float, complex, str, tuple)):
                constants[f"{this.__module__}.{name}"] = value
            elif isinstance(value, np.ndarray):
                constants[f"{this.__module__}.{name}"] = value.tobytes()
            elif module.partition(".")[0] == package:
                files.add(sys.modules[module].__file__)
                if hasattr(value, "__code__"):
                    rest.append(value)
    return files, constants


@functools.cache
def _prune_once(folder: Path) -> None:
    prune(folder)


@functools.cache
def _digest(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()


def _names(code: CodeType) -> Iterator[str]:
    """Global names that ``code`` uses, its inner functions' too."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
