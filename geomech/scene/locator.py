"""Line numbers of the keys of a TOML file: `tomllib` keeps values, not lines."""

from __future__ import annotations

import re
import tomllib

Path = tuple[str | int, ...]

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ITEM = re.compile(r"\[\s*(\d+)\s*\]")
_SCALAR = re.compile(r"[^,\]}#\r\n]*")


def locate(text: str) -> dict[Path, int]:
    """Line (from 1) of every table, key and array item of the valid TOML document ``text``, by its path.

    Paths are those of the parsed document: ("loads", "tractions", 0, "edge"). A table that is only implied by headers
    and dotted keys has the line of its first key.
    """
    return _Scanner(text).lines


def path_of(key: str) -> Path:
    """The path of a dotted key in TOML syntax ('joints."a.b".cohesion_pa', 'geometry.cracks.1.angle_deg').

    Parts that are not bare keys may be unquoted, and items of arrays may be written as in messages,
    "geometry.cracks[1]". Numbers stay texts: their meaning depends on what they index.
    """
    if '"' not in key and "'" not in key:
        key = _ITEM.sub(r".\1", key)
    try:
        node = tomllib.loads(f"{key} = 0")
    except tomllib.TOMLDecodeError:
        return tuple(part.strip() for part in key.split("."))
    parts: list[str] = []
    while isinstance(node, dict):
        (part, node), *_ = node.items()
        parts.append(part)
    return tuple(parts)


def dotted(path: Path) -> str:
    """``path`` as written in messages: loads.tractions[0].edge."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            shown = part if _BARE.fullmatch(part) else f'"{part}"'
            text += f".{shown}" if text else shown
    return text


class _Scanner:
    """One pass over a valid document, following its structure only; values are read and checked by tomllib."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0
        self.lines: dict[Path, int] = {}
        self.counts: dict[Path, int] = {}
        self.table: Path = ()
        self.line, self.counted = 1, 0
        while self._skip():
            if self.text[self.at] == "[":
                self._header()
            else:
                self._pair(self.table)

    def _here(self) -> int:
        self.line += self.text.count("\n", self.counted, self.at)
        self.counted = self.at
        return self.line

    def _note(self, path: Path, line: int) -> None:
        for n in range(1, len(path) + 1):
            self.lines.setdefault(path[:n], line)

    def _skip(self) -> bool:
        """Move past blanks, line ends and comments; False at the end."""
        while self.at < len(self.text):
            c = self.text[self.at]
            if c == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            elif c in " \t\r\n":
                self.at += 1
            else:
                return True
        return False

    def _resolved(self, keys: list[str]) -> Path:
        """Header keys as a path: through an array of tables they refer to its last table."""
        path: Path = ()
        for key in keys:
            path += (key,)
            if path in self.counts:
                path += (self.counts[path] - 1,)
        return path

    def _header(self) -> None:
        line = self._here()
        array = self.text.startswith("[[", self.at)
        self.at += 2 if array else 1
        keys = self._key()
        self.at += 2 if array else 1
        if array:
            base = self._resolved(keys[:-1]) + (keys[-1],)
            self.counts[base] = self.counts.get(base, 0) + 1
            self.table = base + (self.counts[base] - 1,)
        else:
            self.table = self._resolved(keys)
        self._note(self.table, line)

    def _pair(self, table: Path) -> None:
        line = self._here()
        path = table + tuple(self._key())
        self._note(path, line)
        self.at += 1  # "="
        self._value(path)

    def _key(self) -> list[str]:
        keys = []
        while True:
            self._skip()
            if self.text[self.at] in "\"'":
                start = self.at
                self._string()
                (key,) = tomllib.loads(f"{self.text[start : self.at]} = 0")
                keys.append(key)
            else:
                found = _BARE.match(self.text, self.at)
                assert found is not None, "the document is valid"
                keys.append(found.group())
                self.at = found.end()
            self._skip()
            if self.text[self.at] != ".":
                return keys
            self.at += 1

    def _value(self, path: Path) -> None:
        self._skip()
        c = self.text[self.at]
        if c in "\"'":
            self._string()
        elif c == "[":
            self.at += 1
            number = 0
            while self._skip() and self.text[self.at] != "]":
                self._note(path + (number,), self._here())
                self._value(path + (number,))
                number += 1
                self._skip()
                if self.text[self.at] == ",":
                    self.at += 1
            self.at += 1
        elif c == "{":
            self.at += 1
            while self._skip() and self.text[self.at] != "}":
                self._pair(path)
                self._skip()
                if self.text[self.at] == ",":
                    self.at += 1
            self.at += 1
        else:
            found = _SCALAR.match(self.text, self.at)
            assert found is not None, "the document is valid"
            self.at = found.end()

    def _string(self) -> None:
        quote = self.text[self.at]
        if self.text.startswith(quote * 3, self.at):
            self.at += 3
            while not self.text.startswith(quote * 3, self.at):
                self.at += 2 if quote == '"' and self.text[self.at] == "\\" else 1
            self.at += 3
            # Up to two quotes may precede the closing three.
            while self.at < len(self.text) and self.text[self.at] == quote:
                self.at += 1
            return
        self.at += 1
        while self.text[self.at] != quote:
            self.at += 2 if quote == '"' and self.text[self.at] == "\\" else 1
        self.at += 1
