"""Security check of a Gmsh model before Gmsh reads it: a Gmsh script can run programs and write files.

A .geo file is a program. Besides geometry it may run shell commands (SystemCall), write files (Save, Print, Printf >
…), end the process (Exit), read and write memory (formats of Printf) and read other files. Here these are found by name
and line and refused, unless the models are the user's own (`TRUST`). Words are read as by Gmsh's scanner (`Gmsh.l`:
comments, strings in either quotes). Loops and macros make Gmsh jump back to the beginning of a line, where it knows
nothing of a comment or string that began above: in files with loops or macros such lines are also read as code.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from ..mesh_exchange import SUFFIXES as OTHER_MESHES
from .model_drawing import GmshModelError

#: Set to anything but "" or "0", this environment variable allows models to do everything that Gmsh allows.
TRUST = "GEOMECH_TRUST_MODELS"

#: Suffixes by which Gmsh recognises file types; it takes all others for scripts.
SCRIPTS, MESHES, SHAPES = (".geo", ".geo_unrolled"), (".msh",), (".brep", ".step", ".stp", ".STEP", ".STP")
#: Beginning of a mesh; Gmsh takes a .msh that begins otherwise for a script.
_MESH_BEGINS = (b"$PTS", b"$NO", b"$PARA", b"$ELM", b"$MeshFormat", b"$Comments")

#: Words that do more than draw, and their effect.
_DOES = {
    **dict.fromkeys(("System", "SystemCall", "NonBlockingSystemCall"), "runs a shell command"),
    **dict.fromkeys(("OnelabRun", "ExternalProcess"), "runs a program"),
    **dict.fromkeys(("Save", "Print"), "writes a file"),
    "CreateDir": "makes a folder",
    "SendToServer": "sends data to another program",
    "Plugin": "runs a plugin",
    "Exit": "ends this process",
    "Sleep": "waits",
    "GetEnv": "reads this user's environment",
    **dict.fromkeys(("StringToName", "S2N"), "makes commands of text"),
    "Solver": "sets up a program to run",
}
#: Words whose first argument is a format for C's printf: "%s" there reads memory, "%n" writes to it.
_FORMATS = ("Printf", "Sprintf", "Error", "Warning")
#: Admissible content of such a format: "%%", and conversions of a number with limited width.
_NUMBERS = re.compile(rb"(?:[^%]|%%|%[-+ #0]*[0-9]{0,2}(?:\.[0-9]{0,2})?l?[eEfFgG])*", re.DOTALL)
#: Words with which a short script may take unlimited time and memory.
_HEAVY = frozenset(
    b"For Macro Function Call Mesh RefineMesh RelocateMesh OptimizeMesh ClassifySurfaces CreateGeometry Homology "
    b"Cohomology Field LinSpace LogSpace Include Merge MergeWithBoundingBox ShapeFromFile ListFromFile".split()
)
#: Words that read the file named after them.
_READS = ("Include", "Merge", "MergeWithBoundingBox", "ShapeFromFile", "ListFromFile")

#: Gmsh's scanner cuts longer strings, and longer lines of files with loops, and reads the rest as code.
_LONGEST_STRING, _LONGEST_LINE = 1000, 8000

_TOKEN = re.compile(
    rb"""(?P<blank>[ \t\n\r\f]+) | (?P<line>//[^\n]*) | (?P<block>/\*.*?(?:\*/|\Z))
    | (?P<text>"[^"]*(?:"|\Z)|'[^']*(?:'|\Z)) | (?P<word>[A-Za-z_][A-Za-z_0-9]*)
    | (?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?) | (?P<mark>>>|.)""",
    re.VERBOSE | re.DOTALL,
)


class _Token(NamedTuple):
    kind: str
    text: bytes
    line: int


def trusted() -> bool:
    """Whether the user has declared the models to be trusted."""
    return os.environ.get(TRUST, "") not in ("", "0")


def refuse_commands(path: Path, folder: Path | None = None) -> list[Path]:
    """Refuse a model that would do more than draw: raises GmshModelError with file, line and command.

    It may read files below its own folder, or below ``folder``; they are checked as well. Returns all files that Gmsh
    will read, the model first.
    """
    allowed_folders = [path.parent.resolve(), *([folder.resolve()] if folder else [])]
    seen: list[Path] = []
    waiting = [path]
    while waiting:
        file = waiting.pop(0)
        # Gmsh also reads a file of options, MODEL.opt, as a script.
        for found in (
            file,
            *([options_file] if (options_file := file.with_name(file.name + ".opt")).is_file() else []),
        ):
            if found.resolve() in seen:
                continue
            seen.append(found.resolve())
            waiting += _files_of(found, allowed_folders, is_script=found is not file)
    return seen


def is_light(path: Path) -> bool:
    """Whether the cost of the script ``path`` is limited by its length: no loop, macro or range, no mesh, no other
    file."""
    code = [token.text for token in _tokens(path.read_bytes()) if token.kind not in ("line", "block", "text")]
    heavy = any(word in _HEAVY and (word, after) != (b"Mesh", b".") for word, after in pairwise([*code, b""]))
    # A colon follows a question mark, or is alone in braces ("all surfaces"), or is part of a range.
    alone = sum(three == (b"{", b":", b"}") for three in zip(code, code[1:], code[2:], strict=False))
    return not heavy and code.count(b":") - alone <= code.count(b"?")


def files_read(path: Path) -> list[Path]:
    """The model ``path`` and all files that Gmsh reads with it, as far as their names are literal: included and merged
    files, lists of numbers, options, and the files that these read. Nothing is refused."""
    seen: dict[Path, Path] = {}
    waiting = [path]
    while waiting:
        file = waiting.pop(0)
        if file.resolve() in seen or not file.is_file():
            continue
        seen[file.resolve()] = file
        waiting.append(file.with_name(file.name + ".opt"))
        if file.suffix in (*MESHES, *SHAPES):
            continue
        code = [token for token in _tokens(file.read_bytes()) if token.kind not in ("line", "block")]
        for k, token in enumerate(code):
            if token.text.decode("latin-1") in _READS:
                rest = [t for t in code[k + 1 : k + 3] if t.text not in (b"(", b"[")][:1]
                names = [t.text[1:-1].decode("utf-8", "surrogateescape") for t in rest if t.kind == "text"]
                waiting += [file.parent / name for name in names]
    return list(seen.values())


def _files_of(path: Path, allowed_folders: Sequence[Path], is_script: bool) -> list[Path]:
    """The files that ``path`` reads, after a check of its other commands."""
    if not is_script and path.suffix.lower() in OTHER_MESHES:
        return _other_mesh(path)
    if not is_script and path.suffix not in (*SCRIPTS, *MESHES, *SHAPES):
        raise GmshModelError(
            f"{path}: Gmsh would take a file called *{path.suffix} for a script, or not for a drawing",
            f"models are {', '.join((*SCRIPTS, *MESHES, '.step', '.stp', '.brep', *OTHER_MESHES))} (in lower case)",
        )
    if not is_script and path.suffix in SHAPES:
        return []
    data = path.read_bytes()
    if not is_script and path.suffix in MESHES:
        if not data.startswith(_MESH_BEGINS):
            raise GmshModelError(
                f"{path}: this is not a Gmsh mesh: it does not begin with $MeshFormat",
                "save it as .msh again, or call it .geo if it is a script",
            )
        return []
    return _script(path, data, allowed_folders)


def _other_mesh(path: Path) -> list[Path]:
    """Meshes read by meshio name no other files, except that those of Abaqus may include some."""
    if path.suffix.lower() == ".inp":
        for number, line in enumerate(path.read_bytes().split(b"\n"), 1):
            if line.strip().upper().startswith(b"*INCLUDE"):
                raise GmshModelError(
                    f"{path}:{number}: *INCLUDE reads another file", "replace it by the content of that file"
                )
    return []


def _script(path: Path, data: bytes, allowed_folders: Sequence[Path]) -> list[Path]:
    if b"\0" in data:
        line = data[: data.index(b"\0")].count(b"\n") + 1
        raise GmshModelError(f"{path}:{line}: a zero byte in a script", "save it as text")
    tokens = list(_tokens(data))
    words = {token.text for token in tokens if token.kind == "word"}
    jumps = bool(words & {b"For", b"Macro", b"Function"})
    for token in tokens:
        if token.kind == "text" and len(token.text) > _LONGEST_STRING:
            raise GmshModelError(f"{path}:{token.line}: a text without an end", "close its quotes")
    if jumps:
        for number, text in enumerate(re.split(rb"[\r\n]", data), 1):
            if len(text) > _LONGEST_LINE:
                raise GmshModelError(f"{path}:{number}: a line of {len(text)} characters", "break it into shorter ones")
    found = _judged(path, tokens, allowed_folders)
    if jumps:
        for token in tokens:
            if token.kind in ("line", "block", "text") and (hidden := re.search(rb"[\r\n]", token.text)):
                inner = [
                    piece._replace(line=token.line + k)
                    for k, line in enumerate(re.split(rb"[\r\n]", token.text[hidden.end() :]), 1)
                    for piece in _tokens(line)
                ]
                found += _judged(path, inner, allowed_folders, comment=True)
    return found


def _tokens(data: bytes) -> Iterator[_Token]:
    line = 1
    for found in _TOKEN.finditer(data):
        text, kind = found.group(), found.lastgroup
        if kind != "blank":
            yield _Token(str(kind), text, line)
        line += text.count(b"\n")


def _judged(path: Path, tokens: Sequence[_Token], allowed_folders: Sequence[Path], comment: bool = False) -> list[Path]:
    """The files that ``tokens`` read. Raises GmshModelError for other actions."""
    code = [token for token in tokens if token.kind not in ("line", "block")]
    found = []
    for k, token in enumerate(code):
        word = token.text.decode("latin-1") if token.kind == "word" else ""
        following = [t.text for t in code[k + 1 : k + 2]]
        # Print.X = … is an option.
        if word in _DOES and (word, following) != ("Print", [b"."]):
            _refuse(path, token.line, word, _DOES[word], comment)
        option = b"".join(t.text for t in code[k : k + 3]).decode("latin-1")
        if option.startswith("General.") and "File" in option:
            _refuse(path, token.line, option, "names a file to write", comment)
        if word == "Printf" and _is_sent_to_a_file(code[k + 1 :]):
            _refuse(path, token.line, "Printf > …", "writes a file", comment)
        if word in _FORMATS and following == [b"("]:
            _look_at_format(path, token, code[k + 2 : k + 4], comment)
        if word == "FileName" and code[k - 1].text == b"." and not comment:
            _refuse(path, token.line, ".FileName", "reads a file", comment)
        if word in _READS:
            found += _read(path, token, code[k + 1 : k + 4], allowed_folders, comment)
    return found


def _look_at_format(path: Path, token: _Token, rest: Sequence[_Token], comment: bool) -> None:
    """First argument of a word of `_FORMATS`: one literal text that formats nothing but numbers."""
    word = token.text.decode()
    if len(rest) < 2 or rest[0].kind != "text" or rest[1].text not in (b")", b","):
        if not comment:
            _refuse(path, token.line, word, "has a format that is not written out", comment)
    elif not _NUMBERS.fullmatch(rest[0].text):
        _refuse(
            path, token.line, f"{word}({rest[0].text.decode('latin-1')[:40]}", "formats more than numbers (%g)", comment
        )


def _is_sent_to_a_file(rest: Sequence[_Token]) -> bool:
    """Whether ">" follows the parenthesis with which ``rest`` begins."""
    depth = 0
    for k, token in enumerate(rest):
        depth += {b"(": 1, b")": -1}.get(token.text, 0) if token.kind == "mark" else 0
        if depth == 0:
            return [t.text for t in rest[k + 1 : k + 2]] in ([b">"], [b">>"])
    return False


def _read(
    path: Path, token: _Token, rest: Sequence[_Token], allowed_folders: Sequence[Path], comment: bool
) -> list[Path]:
    """The file that such a word reads: its name must be literal, and it must be below one of ``allowed_folders``."""
    word = token.text.decode()
    rest = rest[1:] if rest and rest[0].text in (b"(", b"[") else rest
    if len(rest) < 2 or rest[0].kind != "text" or rest[1].text not in (b";", b")", b"]"):
        if comment:
            return []
        _refuse(path, token.line, word, "reads a file whose name is not written out", comment)
    name = rest[0].text[1:-1].decode("utf-8", "surrogateescape")
    # Gmsh knows neither drives nor "~"; a relative path is relative to the file that names it.
    file = path.parent / name
    if not any(file.resolve().is_relative_to(allowed) for allowed in allowed_folders):
        _refuse(path, token.line, f'{word} "{name}"', f"reads a file outside {allowed_folders[-1]}", comment)
    # Gmsh itself reports missing files; a list of numbers is not a script.
    return [file] if file.is_file() and word not in ("ListFromFile",) else []


def _refuse(path: Path, line: int, what: str, does: str, comment: bool) -> None:
    where = " (in a comment or text of several lines, into which its loops or macros may jump)" if comment else ""
    raise GmshModelError(
        f"{path}:{line}: {what} {does}{where}; a model may draw, and read files below the scene's folder",
        f"remove it; or, if you trust this file and all that it reads, use --trust-models (or {TRUST}=1)",
    )
