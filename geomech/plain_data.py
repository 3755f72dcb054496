"""Objects as plain data: one JSON text and the bytes of arrays, from which nothing but data can come back.

A store is a list of nodes, one for each object that others may refer to: lists, tuples, dictionaries, sets, arrays and
instances of allowed classes. Each object is stored once, however many refer to it. An array that is a view of another
keeps sharing its memory, with the same strides: strides determine how BLAS computes a product, and so its last bits. An
instance is stored as the name of its class and its attributes; it is restored without calling the class, and only
allowed classes can be named. A store may thus contain wrong data, but never code.

Of an array with many zeros, such as matrices of blocks of different order that have the size of the largest, only a bit
for each word of eight bytes and the words other than zero are stored.
"""

from __future__ import annotations

import collections
import importlib
import io
import json
import math
import types
from collections.abc import Callable, Iterable, Sequence
from typing import Any, BinaryIO, Literal, cast

import numpy as np

#: Built-in containers, which are created empty and filled later.
_EMPTY: dict[str, type] = {"l": list, "d": dict, "S": set, "C": collections.Counter, "q": collections.deque}
_KINDS: dict[type, str] = {kind: letter for letter, kind in _EMPTY.items()} | {tuple: "t", frozenset: "F"}


class NotPlain(TypeError):
    """An object that is not data: a function, an open file, an instance of a class that is not allowed."""


class Broken(ValueError):
    """A file that is not a store, or names something that is not allowed."""


class Allowed:
    """Which classes may be stored: all that are defined in the modules below ``parts`` ("geomech.dda"), those named
    "module:Class" in ``classes``, and bound methods "module:Class.method" in ``methods``."""

    def __init__(self, parts: Iterable[str] = (), classes: Iterable[str] = (), methods: Iterable[str] = ()) -> None:
        self.parts, self.classes, self.methods = tuple(parts), frozenset(classes), frozenset(methods)

    def has(self, name: str) -> bool:
        module = name.partition(":")[0]
        return name in self.classes or any(module == part or module.startswith(f"{part}.") for part in self.parts)

    def found(self, name: str) -> type:
        """The class called ``name``. Raises Broken if it is not allowed or does not exist."""
        module, _, path = name.partition(":")
        if not self.has(name):
            raise Broken(f"{name} is not allowed")
        try:
            found: Any = importlib.import_module(module)
            for part in path.split("."):
                found = vars(found)[part]
        except (ImportError, KeyError, TypeError) as error:
            raise Broken(f"there is no {name}") from error
        if not isinstance(found, type) or found.__module__ != module:
            raise Broken(f"{name} is no class of that module")
        return found


def name_of(kind: type) -> str:
    """The name that stands for a ``kind`` of object."""
    return f"{kind.__module__}:{kind.__qualname__}"


def write(file: BinaryIO, value: Any, allowed: Allowed) -> None:
    """Write ``value`` to ``file``. Raises NotPlain for anything that is not data."""
    table = _Table(allowed)
    root = table.written(value)
    # Writing a node may add further nodes.
    for node in table.waiting():
        table.nodes.append(node)
    text = json.dumps(
        {"root": root, "classes": table.classes, "nodes": table.nodes}, separators=(",", ":"), allow_nan=False
    ).encode()
    file.write(len(text).to_bytes(8, "little"))
    file.write(text)
    for array, words in table.arrays:
        _write_array(file, array, words)


def read(file: BinaryIO, allowed: Allowed) -> Any:
    """Read an object written by `write`. Raises Broken for anything else."""
    try:
        length = int.from_bytes(_exactly(file, 8), "little")
        text = json.loads(_exactly(file, length))
        return _Reader(file, text, allowed).value(text["root"])
    except Broken:
        raise
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError, ArithmeticError, EOFError) as error:
        raise Broken(f"no store of plain data: {type(error).__name__}: {error}") from error


def _exactly(file: BinaryIO, length: int) -> bytes:
    found = file.read(length)
    if len(found) != length:
        raise Broken("the file ends early")
    return found


def _memory(array: np.ndarray) -> memoryview:
    """The bytes of a contiguous array in memory order."""
    flat = array.reshape(-1, order="A")
    return (flat.view(np.uint8) if flat.size and flat.dtype.itemsize else np.empty(0, np.uint8)).data


def _words(array: np.ndarray) -> np.ndarray:
    """The words of eight bytes of a contiguous array in memory order; none if its size is no multiple of eight."""
    memory = np.asarray(_memory(array))
    return memory[: 0 if len(memory) % 8 else len(memory)].view(np.uint64)


def _fewer_words(array: np.ndarray) -> int | None:
    """Number of words other than zero if these and a bit for each word take less space than ``array``, else None."""
    words = _words(array)
    number = int(np.count_nonzero(words))
    return number if 8 * number + (len(words) + 7) // 8 < words.nbytes else None


def _write_array(file: BinaryIO, array: np.ndarray, words: int | None) -> None:
    """The memory of ``array``; if its ``words`` other than zero are few, a bit for each word and then those."""
    if words is None:
        file.write(_memory(array))
        return
    every = _words(array)
    nonzero = every != 0
    file.write(np.packbits(nonzero).data)
    file.write(every[nonzero].view(np.uint8).data)


class _Table:
    """Objects as nodes, each once."""

    def __init__(self, allowed: Allowed) -> None:
        self.allowed = allowed
        self.nodes: list[Any] = []
        self.arrays: list[tuple[np.ndarray, int | None]] = []
        self.classes: list[str] = []
        self._class_at: dict[type, int] = {}
        self._at: dict[int, int] = {}
        self._objects: list[Any] = []  # kept alive as long as their ids are used

    def waiting(self):
        done = 0
        while done < len(self._objects):
            yield self._node(self._objects[done])
            done += 1

    def written(self, value: Any) -> Any:
        """``value`` as written in a node: itself, or a reference to its own node."""
        kind = type(value)
        if value is None or kind in (bool, int, str):
            return value
        if kind is float:
            return value if math.isfinite(value) else ["f", str(value)]
        return ["r", self._place(value)]

    def _place(self, value: Any) -> int:
        if id(value) not in self._at:
            self._at[id(value)] = len(self._objects)
            self._objects.append(value)
        return self._at[id(value)]

    def _class(self, kind: type) -> int:
        if kind not in self._class_at:
            name = name_of(kind)
            if not self.allowed.has(name):
                raise NotPlain(f"{name} is none of the classes that are stored")
            self._class_at[kind] = len(self.classes)
            self.classes.append(name)
        return self._class_at[kind]

    def _node(self, value: Any) -> list[Any]:
        kind = type(value)
        if kind is np.ndarray:
            return self._array(value)
        if kind in (list, set, tuple, frozenset, collections.deque):
            head = [value.maxlen] if kind is collections.deque else []
            return [_KINDS[kind], *head, *(self.written(item) for item in value)]
        if kind in (dict, collections.Counter):
            return [_KINDS[kind], *(self.written(part) for pair in value.items() for part in pair)]
        if kind in (bytes, complex):
            return ["b", value.hex()] if kind is bytes else ["c", value.real.hex(), value.imag.hex()]
        if isinstance(value, np.generic) and not value.dtype.hasobject:
            return ["g", _described(value.dtype), value.tobytes().hex()]
        if isinstance(value, np.dtype) and not value.hasobject:
            return ["y", _described(value)]
        if kind is types.MethodType:
            name = f"{name_of(type(value.__self__))}.{value.__name__}"
            if name not in self.allowed.methods:
                raise NotPlain(f"{name} is none of the methods that are stored")
            return ["m", self.written(value.__self__), value.__name__]
        if isinstance(value, tuple) and hasattr(kind, "_fields"):
            return ["n", self._class(kind), *(self.written(item) for item in value)]
        return self._instance(value, kind)

    def _instance(self, value: Any, kind: type) -> list[Any]:
        place = self._class(kind)
        if isinstance(value, (dict, list, tuple, set, np.ndarray)) or hasattr(kind, "__slots__"):
            raise NotPlain(f"{name_of(kind)} keeps more than attributes")
        state = value.__getstate__()
        if hasattr(kind, "__setstate__"):
            return ["s", place, self.written(state)]
        return ["o", place, *(part if k % 2 == 0 else self.written(part) for pair in (state or {}).items()
                              for k, part in enumerate(pair))]  # fmt: skip

    def _array(self, value: np.ndarray) -> list[Any]:
        if value.dtype.hasobject:
            raise NotPlain("an array of objects")
        if type(base := value.base) is np.ndarray:
            (low, high), (first, last) = np.lib.array_utils.byte_bounds(value), np.lib.array_utils.byte_bounds(base)
            if first <= low and high <= last and (base.flags.c_contiguous or base.flags.f_contiguous):
                start = value.__array_interface__["data"][0] - first
                described, layout = _described(value.dtype), [list(value.shape), list(value.strides), start]
                return ["v", self._place(base), described, *layout, value.flags.writeable]
        order: Literal["F", "C"] = "F" if value.flags.f_contiguous and not value.flags.c_contiguous else "C"
        stored = np.asarray(value, order=order)
        words = _fewer_words(stored)
        self.arrays.append((stored, words))
        layout = [_described(value.dtype), list(value.shape), order, value.flags.writeable]
        return ["a", len(self.arrays) - 1, *layout, words]


def _fill(file: BinaryIO, memory: memoryview) -> None:
    # By `readinto`: every binary file has it, although BinaryIO does not promise it.
    if cast(io.BufferedIOBase, file).readinto(memory) != memory.nbytes:
        raise Broken("the file ends within an array")


def _fill_words(file: BinaryIO, every: np.ndarray, words: int) -> None:
    """Read into ``every`` word what `_write_array` has written of an array with ``words`` words other than zero."""
    bits, values = np.empty((len(every) + 7) // 8, np.uint8), np.empty(words, np.uint64)
    _fill(file, bits.data)
    _fill(file, _memory(values))
    nonzero = np.unpackbits(bits, count=len(every)).view(np.bool_)
    if np.count_nonzero(nonzero) != words:
        raise Broken("an array with another number of words")
    every[nonzero] = values


def _described(dtype: np.dtype) -> Any:
    return np.lib.format.dtype_to_descr(dtype)


def _dtype(described: Any) -> np.dtype:
    """The dtype from its description after JSON has turned tuples into lists."""

    def tuples(part: Any) -> Any:
        # [[name, type], [name, type, shape]] are fields; a pair whose first is a type is a subarray.
        if isinstance(part, list):
            return [(field[0], tuples(field[1]), *(tuple(shape) for shape in field[2:])) for field in part]
        return part

    found = np.lib.format.descr_to_dtype(tuples(described))
    if found.hasobject:
        raise Broken("an array of objects")
    return found


class _Reader:
    """Restores objects from nodes: first creates all of them empty, then fills them."""

    def __init__(self, file: BinaryIO, text: dict[str, Any], allowed: Allowed) -> None:
        self.allowed, self.nodes = allowed, text["nodes"]
        self.classes = [allowed.found(name) for name in text["classes"]]
        self.made: dict[int, Any] = {}
        self._bytes(file)
        later: list[tuple[int, Callable[[], None]]] = []
        for k, node in enumerate(self.nodes):
            self._object(k)
            later += self._filling(k, node)
        # Attributes before dictionaries, whose keys may hash by them; objects restored from a whole state last.
        for _, fill in sorted(later, key=lambda entry: entry[0]):
            fill()

    def value(self, written: Any) -> Any:
        if not isinstance(written, list):
            return written
        letter, what = written
        if letter == "f":
            return {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}[what]
        if letter != "r":
            raise Broken(f"{letter!r} means nothing")
        return self._object(what)

    def _values(self, written: Sequence[Any]) -> list[Any]:
        return [self.value(item) for item in written]

    def _bytes(self, file: BinaryIO) -> None:
        """Read the arrays that own their memory, in the order written."""
        own = sorted((node[1], k) for k, node in enumerate(self.nodes) if node[0] == "a")
        start = file.tell()
        left = file.seek(0, io.SEEK_END) - start
        file.seek(start)
        for _, k in own:
            _, _, described, shape, order, writeable, words = self.nodes[k]
            dtype = _dtype(described)
            size = math.prod(shape) * dtype.itemsize
            stored = size if words is None else (size // 8 + 7) // 8 + 8 * words
            # Checked before memory is allocated.
            if min(*shape, words or 0, 0) < 0 or stored > left:
                raise Broken("the file ends within an array")
            array = (np.empty if words is None else np.zeros)(tuple(shape), dtype, order)
            left -= stored
            if words is None:
                _fill(file, _memory(array))
            else:
                _fill_words(file, _words(array), words)
            array.flags.writeable = writeable
            self.made[k] = array

    def _object(self, k: int) -> Any:
        if k not in self.made:
            self.made[k] = self._empty(self.nodes[k])
        return self.made[k]

    def _empty(self, node: list[Any]) -> Any:
        letter, *rest = node
        if letter in _EMPTY:
            return collections.deque(maxlen=rest[0]) if letter == "q" else _EMPTY[letter]()
        if letter in ("o", "s"):
            return object.__new__(self.classes[rest[0]])
        if letter == "n":
            kind = self.classes[rest[0]]
            if not (issubclass(kind, tuple) and hasattr(kind, "_fields") and len(rest) == 1 + len(kind._fields)):
                raise Broken(f"{name_of(kind)} has other fields")
            return tuple.__new__(kind, self._values(rest[1:]))
        made: dict[str, Callable[[], Any]] = {
            "t": lambda: tuple(self._values(rest)),
            "F": lambda: frozenset(self._values(rest)),
            "v": lambda: self._view(*rest),
            "b": lambda: bytes.fromhex(rest[0]),
            "c": lambda: complex(float.fromhex(rest[0]), float.fromhex(rest[1])),
            "g": lambda: np.frombuffer(bytes.fromhex(rest[1]), _dtype(rest[0]))[0],
            "y": lambda: _dtype(rest[0]),
            "m": lambda: self._method(*rest),
        }
        return made[letter]()

    def _view(
        self, owner: int, described: Any, shape: Sequence[int], strides: Sequence[int], start: int, writeable: bool
    ) -> np.ndarray:
        base: np.ndarray = self._object(owner)
        memory = base.reshape(-1, order="A").view(np.uint8) if base.size else np.empty(0, np.uint8)
        dtype = _dtype(described)
        spans = [(n - 1) * step for n, step in zip(shape, strides, strict=True)]
        first, last = start + sum(s for s in spans if s < 0), start + sum(s for s in spans if s > 0) + dtype.itemsize
        if min(shape, default=0) < 0 or (0 not in shape and not 0 <= first <= last <= memory.nbytes):
            raise Broken("a view beyond its array")
        view = np.ndarray(tuple(shape), dtype, memory, start, tuple(strides))
        view.flags.writeable = writeable and view.flags.writeable
        return view

    def _method(self, owner: Any, name: str) -> types.MethodType:
        owner = self.value(owner)
        if f"{name_of(type(owner))}.{name}" not in self.allowed.methods:
            raise Broken(f"{name} is not allowed")
        return types.MethodType(vars(type(owner))[name], owner)

    def _filling(self, k: int, node: list[Any]) -> list[tuple[int, Callable[[], None]]]:
        """Functions that fill the object of a node, with their order."""
        letter, *rest = node
        this = self.made[k]
        if letter in ("l", "q"):
            return [(0, lambda: this.extend(self._values(rest[letter == "q" :])))]
        if letter == "o":
            return [(1, lambda: vars(this).update(zip(rest[1::2], self._values(rest[2::2]), strict=True)))]
        if letter in ("d", "C"):
            # Not Counter.update, which adds.
            keys, values = rest[0::2], rest[1::2]
            return [(2, lambda: dict.update(this, zip(self._values(keys), self._values(values), strict=True)))]
        if letter == "S":
            return [(2, lambda: this.update(self._values(rest)))]
        if letter == "s":
            return [(3, lambda: this.__setstate__(self.value(rest[1])))]
        return []
