"""Former arguments, and former names of exports, accepted for one version with a DeprecationWarning."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping
from dataclasses import fields
from inspect import signature
from typing import Any, TypeVar, cast

_Function = TypeVar("_Function", bound=Callable[..., Any])


def renamed_argument(old: str, new: str) -> Callable[[_Function], _Function]:
    """Decorator: the keyword argument ``old`` of a function is passed as ``new``, with a DeprecationWarning."""

    def decorate(function: _Function) -> _Function:
        @functools.wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            if old in kwargs:
                if new in kwargs:
                    raise TypeError(f"{function.__name__}() got both {new!r} and its former name {old!r}")
                warnings.warn(
                    f"{function.__name__}({old}=…) is now {function.__name__}({new}=…)",
                    DeprecationWarning,
                    stacklevel=2,
                )
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return cast(_Function, called)

    return decorate


def gathered_arguments(new: str, record: type) -> Callable[[_Function], _Function]:
    """Decorator: keyword arguments of a function that are now fields of the dataclass ``record``, its argument ``new``,
    are passed in one record, with a DeprecationWarning."""
    gathered = {field.name for field in fields(record)}

    def decorate(function: _Function) -> _Function:
        @functools.wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            former = {name: kwargs.pop(name) for name in gathered.intersection(kwargs)}
            if former:
                if new in kwargs:
                    raise TypeError(f"{_named(function)}() got both {new!r} and {', '.join(sorted(former))}")
                given = ", ".join(f"{name}=…" for name in sorted(former))
                warnings.warn(
                    f"{_named(function)}({given}) is now {_named(function)}({new}={record.__name__}({given}))",
                    DeprecationWarning,
                    stacklevel=2,
                )
                kwargs[new] = record(**former)
            return function(*args, **kwargs)

        return cast(_Function, called)

    return decorate


def folded_argument(old: str, new: str, fold: Callable[[Any, Any], Any]) -> Callable[[_Function], _Function]:
    """Decorator: the keyword argument ``old`` of a function, if not None, is passed within its argument ``new``, as
    ``fold(new, old)``, with a DeprecationWarning."""

    def decorate(function: _Function) -> _Function:
        @functools.wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            value = kwargs.pop(old, None)
            if value is not None:
                given = signature(function).bind_partial(*args, **kwargs)
                given.arguments[new] = fold(given.arguments.get(new), value)
                warnings.warn(
                    f"{_named(function)}({old}=…) is part of {new}=… now", DeprecationWarning, stacklevel=2
                )  # fmt: skip
                args, kwargs = given.args, given.kwargs
            return function(*args, **kwargs)

        return cast(_Function, called)

    return decorate


def named_argument(name: str, position: int) -> Callable[[_Function], _Function]:
    """Decorator: the argument at ``position`` (from 0) is passed by its ``name``, with a DeprecationWarning."""

    def decorate(function: _Function) -> _Function:
        @functools.wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            if len(args) == position + 1:
                if name in kwargs:
                    raise TypeError(f"{_named(function)}() got {name!r} twice")
                warnings.warn(f"{_named(function)} takes {name}=… by its name now", DeprecationWarning, stacklevel=2)
                kwargs[name] = args[position]
                args = args[:position]
            return function(*args, **kwargs)

        return cast(_Function, called)

    return decorate


def _named(function: Callable[..., Any]) -> str:
    """The name that a user calls: the class, for its ``__init__``."""
    return function.__qualname__.removesuffix(".__init__")


def renamed_exports(module: str, renamed: Mapping[str, str], names: Mapping[str, Any]) -> Callable[[str], Any]:
    """The ``__getattr__`` of ``module``, whose globals are ``names``: a former name (a key of ``renamed``) gives the
    object under its present name, with a DeprecationWarning. Other names raise AttributeError."""

    def find(name: str) -> Any:
        if name not in renamed:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warnings.warn(f"{module}.{name} is now {module}.{renamed[name]}", DeprecationWarning, stacklevel=2)
        return names[renamed[name]]

    return find
