"""Cache of compiled kernels that takes account of everything a kernel calls.

Numba stores compiled code with a digest of the file that contains the kernel. Functions of other files that the kernel
calls are part of its code, so after a change of these alone the old code would be used. Here the digest includes them.

Numba also leaves the compiled copies of called functions open to replacement by code of the same name that was loaded
earlier. In the run that compiles, that is the function compiled by itself; in later runs it is the kernel's own copy,
which was optimised together with the kernel and fuses other products and sums: the last digits differ. Here the copies
belong to the kernel alone, and functions that only kernels call (`part`) are not compiled to machine code elsewhere.

Most of the compilation time is spent in Numba, not in LLVM. While kernels are compiled, the results of type inference
for given argument types are cached, settings are compared by the values set, the variables of statements are listed
without copies, their lifetimes computed only where used, and a `part` is compiled once for all integer arguments, not
once for each constant. Garbage is left to later collections, and the compiler's call frames share one piece of memory
(`_ROOM`). In LLVM, code whose instructions may not be fused is optimised thoroughly once only, after linking.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import logging
import re
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np
from llvmlite import binding as llvm
from llvmlite import ir as llvmir
from numba import __version__ as numba_version
from numba import config, jit, njit, types

from .kernel_folder import SOURCE, kernel_place, prune

log = logging.getLogger(__name__)

try:
    from numba.core import ssa
    from numba.core.base import BaseContext
    from numba.core.caching import IndexDataCacheFile, UserProvidedCacheLocator
    from numba.core.codegen import CPUCodegen, JITCodeLibrary
    from numba.core.compiler import Compiler
    from numba.core.datamodel.manager import DataModelManager
    from numba.core.dispatcher import Dispatcher
    from numba.core.inline_closurecall import InlineClosureCallPass
    from numba.core.ir import Assign, Expr, FreeVar, Global, Inst, Loc, SetItem, Var
    from numba.core.options import DefaultOptions
    from numba.core.postproc import PostProcessor, VariableLifetime
    from numba.core.runtime.context import NRTContext
    from numba.core.targetconfig import ConfigStack, TargetConfig
    from numba.core.transforms import canonicalize_cfg
    from numba.core.typed_passes import NopythonRewrites
    from numba.core.types.abstract import _TypeMetaclass
    from numba.core.types.functions import BaseFunction
    from numba.core.typing.templates import _OverloadFunctionTemplate
except ImportError:  # logged below; classes that stand in for those that this version lacks
    IndexDataCacheFile = UserProvidedCacheLocator = CPUCodegen = JITCodeLibrary = Compiler = object
    ConfigStack = TargetConfig = DefaultOptions = _OverloadFunctionTemplate = object
    BaseContext = DataModelManager = NRTContext = Inst = Loc = Var = PostProcessor = VariableLifetime = (
        canonicalize_cfg
    ) = object
    ssa = InlineClosureCallPass = NopythonRewrites = object
    _TypeMetaclass = object  # type: ignore[misc, assignment]
    Assign = Expr = FreeVar = Global = SetItem = object
    BaseFunction = object  # type: ignore[misc, assignment]
    Dispatcher = type(njit(lambda: None))  # type: ignore[misc]

#: Internals of Numba that are used here; they may change in any version.
_INNER = (
    (JITCodeLibrary, ("_finalize_final_module", "_finalize_dynamic_globals", "_get_module_for_linking",
                      "add_ir_module", "_optimize_functions", "_raise_if_finalized")),
    (CPUCodegen, ("_function_pass_manager",)),
    (IndexDataCacheFile, ("_load_index", "_load_data", "_save_data", "_dump", "_data_path",
                          "_open_for_write", "load", "save")),
    (Compiler, ("compile_extra",)),
    (UserProvidedCacheLocator, ("from_function", "ensure_cache_path", "get_cache_path")),
    (Dispatcher, ("_insert", "_compile_for_args", "get_call_template")),
    (BaseFunction, ("get_call_type",)),
    (Inst, ("_rec_list_vars", "list_vars")),
    (PostProcessor, ("run", "_insert_var_dels")),
    (InlineClosureCallPass, ("run",)),
    (NopythonRewrites, ("run_pass",)),
    (_TypeMetaclass, ("__instancecheck__",)),
    (ssa, ("_run_ssa_block_pass",)),
    (BaseContext, ("refresh", "get_abi_sizeof")),
    (NRTContext, ("get_meminfos",)),
    (_OverloadFunctionTemplate, ("_get_impl", "_get_jit_decorator")),
    (ConfigStack, ("top_or_none", "enter")),
    (TargetConfig, ("copy", "values", "options", "__hash__")),
    (config, ("CACHE_LOCATOR_CLASSES", "CACHE_DIR")),
)  # fmt: skip


def moved() -> list[str]:
    """The members of `_INNER` that this version of Numba lacks."""
    return [f"{owner.__name__}.{name}" for owner, names in _INNER for name in names if not hasattr(owner, name)]


#: Whether kernels are compiled and cached as described above. Otherwise Numba's own cache is used: compiling takes twice
#: as long, and last digits may differ between the run that compiles and later ones. (Below, a version of Numba that is
#: newer than `NEWEST` is tried.)
OWN_WAY = not moved()
#: The newest version of Numba with which all tests of this module have passed.
NEWEST = (0, 68)
if not OWN_WAY:
    log.warning("Numba %s lacks %s: kernels are stored in Numba's own cache", numba_version, ", ".join(moved()))
if kernel_place().instead_of is not None:
    log.warning(
        "%s is not writable: compiled kernels are stored in %s (NUMBA_CACHE_DIR sets another folder)",
        kernel_place().instead_of, kernel_place().folder,
    )  # fmt: skip


#: Options of `kept` and `part` for functions that allocate and return no arrays, neither themselves nor in functions they
#: call: they switch off reference counting, which takes most of the time in loops that pass arrays to many small
#: functions, and about a tenth of the compilation time.
UNCOUNTED = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}


def kept(**options) -> Callable:
    """``njit(cache=True, **options)`` for a kernel that Python calls. The cached code depends on the sources of
    everything it calls within its package, and uses no code compiled elsewhere."""

    def compiled(function: Callable) -> Dispatcher:
        if not OWN_WAY:
            return _kept_by_numba(function, options)
        # Set only while this kernel is declared: other packages keep their own cache.
        before = config.CACHE_LOCATOR_CLASSES, config.CACHE_DIR
        config.CACHE_LOCATOR_CLASSES, config.CACHE_DIR = f"{__name__}.WithCalled", kernel_place().folder
        try:
            made = njit(cache=True, no_cfunc_wrapper=True, pipeline_class=_KernelCompiler, **options)(function)
        finally:
            config.CACHE_LOCATOR_CLASSES, config.CACHE_DIR = before
        if isinstance(made, Dispatcher):  # False if compilation is switched off
            file = vars(made)["_cache"]._cache_file
            file.__class__ = _CacheFile
            # Differs from Numba's own name: those files have no checksums.
            file._index_path = str(Path(file._index_path).with_suffix(".summed.nbi"))
            made.get_call_template = functools.partial(_with_any_integer, made.get_call_template)  # type: ignore[method-assign]
        return made

    return compiled


def _kept_by_numba(function: Callable, options: dict) -> Dispatcher:
    """``njit(cache=True, **options)`` of a ``function``, with Numba's own cache in a folder of its own for these sources of
    geomech: that cache takes account of the file with the function only."""
    before = getattr(config, "CACHE_DIR", "")
    config.CACHE_DIR = str(Path(kernel_place().folder) / f"of_numba_{_digest_of_package()}")
    try:
        compiler = {"pipeline_class": _ReportedCompiler} if hasattr(Compiler, "compile_extra") else {}
        return njit(cache=True, **compiler, **options)(function)
    finally:
        config.CACHE_DIR = before


def part(**options) -> Callable:
    """``njit(**options)`` for functions that only kernels call: they are compiled with the kernels."""

    def compiled(function: Callable) -> Dispatcher:
        if not OWN_WAY:
            return njit(**options)(function)
        made = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler, **options)(function)
        # A call from Python is refused with a message; nothing is stored where such a call would look for it.
        made._insert = lambda *signature, **how: None
        made._compile_for_args = functools.partial(_refuse, function.__qualname__)
        made.get_call_template = functools.partial(_with_any_integer, made.get_call_template)
        return made

    return compiled


def _refuse(name: str, *args, **kwargs) -> None:
    raise TypeError(f"{name} is part of kernels, which alone can call it")


def _with_any_integer(get_call_template: Callable, args: tuple, kws: dict) -> tuple:
    """The call of a function with the types ``args`` and ``kws``, with constants replaced by the integer type."""
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
    """Analysis and type inference of Numba with the quicker functions below in this context."""
    replaced = (
        (BaseFunction, "get_call_type", _remembered_call_type),
        (_OverloadFunctionTemplate, "_get_impl", _implementation_for_kernels),
        (_OverloadFunctionTemplate, "_get_jit_decorator", _as_a_part),
        (TargetConfig, "__eq__", _same_settings),
        (TargetConfig, "__hash__", _hash_of_settings),
        (Inst, "_rec_list_vars", _variables_of),
        (PostProcessor, "run", _without_entry_variables),
        (InlineClosureCallPass, "run", _inline_what_there_is),
        (NopythonRewrites, "run_pass", _rewrite_what_there_is),
        (_TypeMetaclass, "__instancecheck__", type.__instancecheck__),
        (ssa, "_run_ssa_block_pass", _without_messages),
        (BaseContext, "refresh", _refresh_if_new),
        (BaseContext, "get_abi_sizeof", _remembered_size),
        (NRTContext, "get_meminfos", _counted_in),
    )
    before, collects = [(owner, name, getattr(owner, name)) for owner, name, _ in replaced], gc.isenabled()
    # A compiler's objects are in use until it is done; garbage collection would take a twentieth of the time.
    gc.disable()
    try:
        for owner, name, replacement in replaced:
            setattr(owner, name, replacement)
        yield
    finally:
        for owner, name, original in before:
            setattr(owner, name, original)
        if collects:
            # What is left of a compiler is garbage with cycles. It joins the oldest generation, which is collected if the
            # program goes on for long: to collect it now takes another twelfth of the time. (Memory of a slope's first run:
            # 650 instead of 350 MB.)
            gc.freeze()
            gc.unfreeze()
            gc.enable()


_call_type: Callable = getattr(BaseFunction, "get_call_type", _refuse)
_signatures: dict[tuple, list[tuple]] = {}


def _remembered_call_type(self: BaseFunction, context, args: tuple, kws: dict):
    """The signature of a call of ``self``, cached by types and settings: Numba tries all declared signatures in each of
    several passes of inference."""
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
    """The present settings without those that do not affect functions called by kernels or parts; for functions of
    other packages, all settings."""
    settings = ConfigStack.top_or_none().copy()
    settings.no_cpython_wrapper = settings.no_cfunc_wrapper = settings.release_gil = True
    return settings


_implementation: Callable = getattr(_OverloadFunctionTemplate, "_get_impl", _refuse)


def _implementation_for_kernels(self: _OverloadFunctionTemplate, args: tuple, kws: dict):
    """Implementation of one of Numba's own functions for these argument types, cached for all kernels."""
    with ConfigStack().enter(_settings_for_kernels()):
        return _implementation(self, args, kws)


def _as_a_part(self: _OverloadFunctionTemplate) -> Callable:
    """Compile Numba's own functions as a `part` of the kernels that call them, and not separately."""
    return functools.partial(jit, no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler)


def _same_settings(self: TargetConfig, other: object) -> bool:
    """Whether two sets of settings are equal, decided by the values set in either; the others are defaults in both."""
    if not isinstance(other, TargetConfig):
        return NotImplemented
    values, other_values = self._values, other._values
    if self is other or values == other_values:
        return True
    if type(self) is not type(other):
        return self.values() == other.values()
    options = self.options
    for name in values.keys() | other_values.keys():
        default = options[name].default
        if values.get(name, default) != other_values.get(name, default):
            return False
    return True


#: Types of most values in a statement that contain no variables.
_NO_VARIABLES = frozenset((Loc, str, int, float, bool, type(None)))


def _variables_of(self: Inst, value: object) -> list:
    """The variables in ``value``, a part of a statement, in Numba's order; without a list for each thing in it."""
    found: list = []
    _find_variables(value, found)
    return found


def _find_variables(value: Any, found: list) -> None:
    """Append the variables in ``value`` to ``found``."""
    kind = type(value)
    if kind is Var:
        found.append(value)
    elif kind is Expr:
        for each in value._kws.values():
            if type(each) not in _NO_VARIABLES:
                _find_variables(each, found)
    elif isinstance(value, Inst):
        found.extend(value.list_vars())
    elif isinstance(value, (list, tuple, dict)):
        for each in value.values() if isinstance(value, dict) else value:
            if type(each) not in _NO_VARIABLES:
                _find_variables(each, found)


_post_process: Callable = getattr(PostProcessor, "run", _refuse)


def _without_entry_variables(self: PostProcessor, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Process statements as Numba does after each of nine passes, without the variables that may exist where a block of
    statements begins: only generators and Python objects need these. Lifetimes of variables are computed where used."""
    function = self.func_ir
    if function.is_generator:
        _post_process(self, emit_dels, extend_lifetimes)
        return
    function.blocks = canonicalize_cfg(function.blocks)
    function.variable_lifetime, function.generator_info = VariableLifetime(function.blocks), None
    if emit_dels:
        self._insert_var_dels(extend_lifetimes=extend_lifetimes)


_inline: Callable = getattr(InlineClosureCallPass, "run", _refuse)


def _inline_what_there_is(self: InlineClosureCallPass) -> None:
    """Inline closures, reductions, stencils and array comprehensions, if the function has any: most have none, and to
    look for them Numba computes the lifetimes of all variables and all loops."""
    if any(_may_be_inlined(statement) for block in self.func_ir.blocks.values() for statement in block.body):
        _inline(self)


#: Names of functions whose calls Numba inlines before inference, of modules that contain them, and of types.
_INLINED = ("functools", "reduce", "numba", "stencil", "StencilFunc", "list")


def _may_be_inlined(statement: Any) -> bool:
    value: Any = statement.value if type(statement) is Assign else None
    if type(value) is Expr:
        return value.op in ("make_function", "build_list")
    if type(value) in (Global, FreeVar):
        names = (getattr(value.value, "__name__", None), type(value.value).__name__)
        return any(name in _INLINED for name in names)
    return False


_rewrite: Callable = getattr(NopythonRewrites, "run_pass", _refuse)


def _rewrite_what_there_is(self: NopythonRewrites, state) -> bool:
    """Rewrite expressions of whole arrays, arrays of constants and items named by texts, if the function has any."""
    blocks, kinds = state.func_ir.blocks.values(), state.typemap
    if any(_may_be_rewritten(statement, kinds) for block in blocks for statement in block.body):
        return _rewrite(self, state)
    return True


def _may_be_rewritten(statement: Any, kinds: dict) -> bool:
    if type(statement) is SetItem:
        return isinstance(kinds[statement.index.name], types.StringLiteral)
    value: Any = statement.value if type(statement) is Assign else None
    if type(value) is not Expr:
        return False
    if value.op == "getitem":
        return isinstance(kinds[value.index.name], types.StringLiteral)
    if value.op == "call":
        called = kinds.get(value.func.name)
        return isinstance(called, types.Function) and hasattr(called.typing_key, "nin")
    if value.op in ("unary", "binop"):
        return isinstance(kinds.get(statement.target.name), types.Array)
    return value.op == "build_list"


def _without_messages(states: dict, block, handler) -> Iterator:
    """As `numba.core.ssa._run_ssa_block_pass`, without a debug message for each statement."""
    for statement in block.body:
        if isinstance(statement, Assign):
            yield handler.on_assign(states, statement)
        else:
            yield handler.on_other(states, statement)


_refresh: Callable = getattr(BaseContext, "refresh", _refuse)
#: By identity: registries of a context, and the number of declarations in them when they were last loaded.
_loaded: dict[int, tuple[dict, int]] = {}


def _refresh_if_new(self: BaseContext) -> None:
    """Load new declarations, if there are any: Numba looks for them whenever a function has none for given types."""
    registries, known = self._registries, _number_of_declarations(self)
    if _loaded.get(id(registries), ({}, -1))[1] != known:
        _refresh(self)
        _loaded[id(registries)] = registries, _number_of_declarations(self)


def _number_of_declarations(context: BaseContext) -> int:
    registries = (*context._registries, *context.typing_context._registries)
    return sum(len(each) for registry in registries for each in vars(registry).values() if isinstance(each, list))


_size: Callable = getattr(BaseContext, "get_abi_sizeof", _refuse)
_sizes: dict[tuple, int] = {}


def _remembered_size(self: BaseContext, ty: llvmir.Type) -> int:
    """The size of a type, cached by its text unless that contains names: LLVM is given a text to read for each."""
    text = str(ty)
    if "%" in text:
        return _size(self, ty)
    key = type(self), text
    if key not in _sizes:
        _sizes[key] = _size(self, ty)
    return _sizes[key]


def _counted_in(self: NRTContext, builder: llvmir.IRBuilder, ty: types.Type, value: llvmir.Value) -> list[tuple]:
    """The (type, counted object) in a ``value``, in Numba's order; of members that contain none no code is made. (To
    release an array, Numba takes out its shape, its strides and five other members: a seventh of all code for LLVM.)"""
    manager = self._context.data_model_manager
    model = manager[ty]
    found = [(ty, model.get_nrt_meminfo(builder, value))] if model.has_nrt_meminfo() else []
    for inner, member in model.traverse(builder):
        if _contains_counted(manager, inner):
            found += self.get_meminfos(builder, inner, member(value))
    return found


@functools.cache
def _contains_counted(manager: DataModelManager, ty: types.Type) -> bool:
    return manager[ty].contains_nrt_meminfo()


@functools.cache
def _hash_of(options: tuple[str, ...]) -> int:
    return hash(tuple(sorted(options)))


def _hash_of_settings(self: TargetConfig) -> int:
    """Same value as Numba's own hash, which uses the names of settings only."""
    return _hash_of(tuple(self.options))


class _Kernel(JITCodeLibrary):
    """Machine code that calls its own copies of the functions it was linked with."""

    def add_ir_module(self, module: llvmir.Module) -> None:
        self._fused = _may_be_fused(module)
        super().add_ir_module(module)

    def _optimize_functions(self, module: llvm.ModuleRef) -> None:
        _optimize_defined(self, module, self._fused)

    def _finalize_final_module(self) -> None:
        # Other kernels are linked with the original: they must find one copy, not one for each path to it.
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
    """Code for linking, without machine code."""

    @property
    def codegen(self) -> _Part:
        return self

    def set_env(self, name: str, environment) -> None:
        """Store the Python environment of the code, for the kernels linked with it."""
        self.environment = name, environment

    def add_ir_module(self, module: llvmir.Module) -> None:
        self._fused = _may_be_fused(module)
        super().add_ir_module(module)

    def _optimize_functions(self, module: llvm.ModuleRef) -> None:
        _optimize_defined(self, module, self._fused)

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._shared_module = _for_linking(self._final_module)
        self._finalized = True


#: Flags of LLVM's instructions that permit to fuse or reorder them.
_FAST = frozenset(("fast", "reassoc", "nnan", "ninf", "nsz", "arcp", "contract", "afn"))


def _may_be_fused(module: llvmir.Module) -> bool:
    """Whether any instruction of a ``module`` may be fused with others or reordered."""
    return any(
        not _FAST.isdisjoint(instruction.flags) or not _FAST.isdisjoint(getattr(instruction, "fastmath", ()))
        for function in module.functions
        for block in function.blocks
        for instruction in block.instructions
    )


def _optimize_defined(library: JITCodeLibrary, module: llvm.ModuleRef, fused: bool) -> None:
    """As `CPUCodeLibrary._optimize_functions`, without passes for functions that are only declared, and at LLVM's first
    level unless instructions may be ``fused``: `finalize` optimises all of a kernel again at the level of Numba. Where
    they may be fused, the level before linking decides which are."""
    level = {} if fused else {"opt": 1}
    module.data_layout = library._codegen._data_layout
    for function in module.functions:
        if not function.is_declaration:
            passes, builder = library._codegen._function_pass_manager(**level)
            passes.run(function, builder)


def _for_linking(module: llvm.ModuleRef) -> llvm.ModuleRef:
    """A copy for linking, as by `CPUCodeLibrary._get_module_for_linking`."""
    shared = module.clone()
    for function in shared.functions:
        if not function.is_declaration and function.linkage == llvm.Linkage.external:
            function.linkage = "linkonce_odr"
    return shared


def _environments(library: JITCodeLibrary) -> dict:
    """Environments of the parts that a ``library`` was linked with, by name."""
    found: dict[str, Any] = {}
    for linked in library._linking_libraries:
        found |= _environments(linked)
        if isinstance(linked, _Part):
            found |= [linked.environment]
    return found


def _with_room(call: Callable, *given):
    """``call(*given)`` below a frame of `_ROOM` words."""
    return call(*given)


#: Size of the frame of `_with_room`, in words. CPython keeps frames in chunks of 16 KB, or of the next power of two that
#: holds a larger frame. A call that crosses the end of a chunk takes a new one from the system and returns it: page faults
#: each time, and a deep compiler makes such calls for seconds. After this frame there remains nearly a
#: megabyte of its chunk. (Measured on a slope's first run: 75 000 page faults instead of 461 000, and 3 of 28 s less.)
_ROOM = 140_000
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=_ROOM)


class _ReportedCompiler(Compiler):
    """Numba's compiler, with a message for each kernel."""

    def compile_extra(self, function: Callable, *given, **named):
        log.debug(_KernelCompiler.message, function.__qualname__)
        return super().compile_extra(function, *given, **named)


class _KernelCompiler(Compiler):
    """Numba's compiler with a `_Kernel` as output."""

    library = _Kernel
    message = "compiling %s"

    def compile_extra(self, function: Callable):
        if self.message:
            log.debug(self.message, function.__qualname__)
        if self.state.library is None:
            self.state.library = self.library(self.state.targetctx.codegen(), function.__qualname__)
            self.state.library.enable_object_caching()
        with _quick_inference():
            result = _with_room(super().compile_extra, function)
        self._check_uncounted(function, result.signature.return_type)
        return result

    def _check_uncounted(self, function: Callable, returned: types.Type) -> None:
        """Refuse a function without reference counting that returns arrays: its caller would release them."""
        state = self.state
        if not state.flags.nrt and state.targetctx.data_model_manager[returned].contains_nrt_meminfo():
            raise TypeError(f"{function.__qualname__} returns arrays, so it cannot be UNCOUNTED")


class _PartCompiler(_KernelCompiler):
    """Numba's compiler with a `_Part` as output."""

    library = _Part
    message = ""


class _CacheFile(IndexDataCacheFile):
    """Numba's cache file with a checksum: damaged entries are compiled again, and write errors are logged."""

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
            log.warning("a compiled kernel cannot be stored in %s: %s", self._cache_path, error.strerror or error)

    def _load_data(self, name: str):
        stored = Path(self._data_path(name)).read_bytes()
        if zlib.crc32(stored[:-4]).to_bytes(4, "little") != stored[-4:]:
            raise ValueError("its checksum does not match")
        return super()._load_data(name)

    def _save_data(self, name: str, data) -> None:
        stored = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            # The checksum follows the data that unpickling reads.
            file.write(stored + zlib.crc32(stored).to_bytes(4, "little"))

    def _drop(self, path: Path, error: Exception) -> None:
        log.warning("%s is damaged (%s): compiled again", path, error)
        path.unlink(missing_ok=True)


class WithCalled(UserProvidedCacheLocator):
    """The user's folder of kernels. A kernel's stamp covers its own file, the files of functions it calls, and all
    global constants used."""

    def __init__(self, function: Callable, file: str) -> None:
        super().__init__(function, file)
        self._function, self._file = function, file

    def ensure_cache_path(self) -> None:
        """Create the folder with a note of its kernels' source; remove kernels whose sources no longer exist."""
        try:
            super().ensure_cache_path()
            source_note = Path(self.get_cache_path()) / SOURCE
            if not source_note.exists():
                source_note.write_text(str(Path(self._file).absolute()), encoding="utf-8")
            _prune_once(source_note.parent.parent)
        except OSError as error:
            log.debug("%s: %s", self.get_cache_path(), error)  # a warning follows when a kernel cannot be stored

    def get_source_stamp(self) -> str:
        files, constants = compiled_in(self._function)
        parts = [_digest(Path(file)) for file in sorted({self._file, *files})]
        return hashlib.sha256(b"".join(parts) + repr(sorted(constants.items())).encode()).hexdigest()


def compiled_in(function: Callable) -> tuple[set[str], dict[str, object]]:
    """Sources of the compiled code of ``function``: the files of its package that define the functions it calls,
    recursively, and the global numbers and arrays that these use (module.name → value, or an array's bytes)."""
    package, files, seen, rest = function.__module__.partition(".")[0], set[str](), set[Callable](), [function]
    constants: dict[str, object] = {}
    while rest:
        this = rest.pop()
        if this in seen:
            continue
        seen.add(this)
        for name in _names(this.__code__):
            value: Any = this.__globals__.get(name)
            value = value.py_func if isinstance(value, Dispatcher) else value
            module = getattr(value, "__module__", None) or ""
            if isinstance(value, (bool, int, float, complex, str, tuple)):
                constants[f"{this.__module__}.{name}"] = value
            elif isinstance(value, np.ndarray):
                constants[f"{this.__module__}.{name}"] = value.tobytes()
            elif module.partition(".")[0] == package:
                source = sys.modules[module].__file__
                if source is not None:
                    files.add(source)
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
    """Global names used in ``code`` and its inner functions."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)


@functools.cache
def _digest_of_package() -> str:
    """Of all sources of geomech."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return hashlib.sha256(b"".join(_digest(file) for file in files)).hexdigest()[:16]


def _running_total(values):
    totals = np.empty_like(values)
    _add_up(values, totals)
    return totals


def _added_up(values, totals):
    total = 0.0
    for i in range(len(values)):
        total += values[i]
        totals[i] = total


def _fault() -> str:
    """What prevents this version of Numba from compiling, storing and loading a kernel with a part in the way described
    above; empty if nothing does."""
    global _add_up
    try:
        _add_up = part(error_model="numpy")(_added_up)
        totals = kept(error_model="numpy")(_running_total)(np.array([1.0, 2.0, 4.0]))
        again = kept(error_model="numpy")(_running_total)
        loaded = again(np.array([1.0, 2.0, 4.0]))
        if again.stats.cache_misses or totals.tolist() != [1.0, 3.0, 7.0] or loaded.tolist() != totals.tolist():
            return "a kernel was not stored"
    except Exception as error:  # whatever has changed
        return f"{type(error).__name__}: {error}"
    return ""


_add_up: Callable
if OWN_WAY and tuple(map(int, re.findall(r"\d+", numba_version)[:2])) > NEWEST:
    _wrong = _fault()
    if _wrong:
        OWN_WAY = False
        log.warning("Numba %s is unknown (%s): kernels are stored in Numba's own cache", numba_version, _wrong)
