"""Former arguments, and former names of what packages export, accepted for one version with a DeprecationWarning."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping
from dataclasses import fields
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
    """Decorator: keyword arguments of a function that are fields of the dataclass ``record`` now, its argument ``new``, are
    passed in one, with a DeprecationWarning."""
    gathered = {field.name for field in fields(record)}

    def decorate(function: _Function) -> _Function:
        @functools.wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            former = {name: kwargs.pop(name) for name in gathered.intersection(kwargs)}
            if former:
                if new in kwargs:
                    raise TypeError(f"{function.__name__}() got both {new!r} and {', '.join(sorted(former))}")
                given = ", ".join(f"{name}=…" for name in sorted(former))
                warnings.warn(
                    f"{function.__name__}({given}) is now {function.__name__}({new}={record.__name__}({given}))",
                    DeprecationWarning,
                    stacklevel=2,
                )
                kwargs[new] = record(**former)
            return function(*args, **kwargs)

        return cast(_Function, called)

    return decorate


def renamed_exports(module: str, renamed: Mapping[str, str], names: Mapping[str, Any]) -> Callable[[str], Any]:
    """The ``__getattr__`` of ``module``, whose globals are ``names``: former names (the keys of ``renamed``) give what is
    called otherwise now, with a DeprecationWarning. Other names raise AttributeError."""

    def find(name: str) -> Any:
        if name not in renamed:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warnings.warn(f"{module}.{name} is now {module}.{renamed[name]}", DeprecationWarning, stacklevel=2)
        return names[renamed[name]]

    return find
