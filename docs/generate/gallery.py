"""The pictures of the gallery: how each is made, and whether what it is made from has changed since.

    python -m docs.generate.gallery --check              # which are stale
    python -m docs.generate.gallery [NAME …]             # remake all that are stale, or those named

``outputs/gallery/gallery.toml`` lists every picture with its command and its sources: scenes, models and the modules of
its study. A digest of what the sources mean (Python without comments and docstrings, TOML as data, models without
comments) is written there when a picture is made.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
GALLERY = ROOT / "outputs" / "gallery"
LIST = GALLERY / "gallery.toml"


@dataclass(frozen=True)
class Picture:
    """A picture ``file`` of the gallery: ``command`` (several with "&&") leaves it as ``makes``, below the folder that
    {out} stands for or, of a benchmark, below the checkout;
    ``sources`` are patterns below the checkout, ``digest`` what they were when it was made."""

    file: str
    command: str
    makes: str
    sources: tuple[str, ...]
    digest: str = ""

    @property
    def stale(self) -> bool:
        """Whether its sources have changed since it was made."""
        return self.digest != digest(self.sources)


def pictures() -> list[Picture]:
    """All pictures of the list."""
    entries = tomllib.loads(LIST.read_text(encoding="utf-8"))
    return [
        Picture(file, entry["command"], entry["makes"], tuple(entry["sources"]), entry.get("digest", ""))
        for file, entry in entries.items()
    ]


def digest(sources: Sequence[str]) -> str:
    """Of the meaning of all files that the patterns ``sources`` name. Raises FileNotFoundError for one that names
    none."""
    total = hashlib.sha256()
    for pattern in sources:
        files = sorted(ROOT.glob(pattern))
        if not files:
            raise FileNotFoundError(f"{LIST}: no file {pattern}")
        for path in files:
            total.update(f"{path.relative_to(ROOT)}\n{meaning(path.name, path.read_text(encoding='utf-8'))}\n".encode())
    return total.hexdigest()[:16]


def meaning(name: str, text: str) -> str:
    """``text`` of the file ``name`` without what changes nothing: comments, docstrings, layout."""
    if name.endswith(".toml"):
        return json.dumps(tomllib.loads(text), sort_keys=True, default=str)
    if name.endswith(".py"):
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
                node.body = node.body[1:]
        return json.dumps(_plain(tree))
    return "\n".join(line for raw in text.splitlines() if (line := re.sub(r"//.*", "", raw).strip()))


def _plain(node: object) -> object:
    """A syntax tree as lists and texts, without empty fields, which differ between versions of Python."""
    if isinstance(node, ast.AST):
        fields = [[name, _plain(value)] for name, value in ast.iter_fields(node) if value is not None and value != []]
        return [type(node).__name__, *fields]
    return [_plain(each) for each in node] if isinstance(node, list) else repr(node)


def make(picture: Picture) -> None:
    """Run the picture's command and put what it made into the gallery, with the digest of its sources."""
    with tempfile.TemporaryDirectory() as folder:
        for each in picture.command.split(" && "):
            verb = shlex.split(each.replace("{out}", folder))[1:]
            subprocess.run([sys.executable, "-m", "geomech", *verb], cwd=ROOT, check=True)
        # Benchmarks have a folder of their own.
        made = ROOT / picture.makes if picture.makes.startswith("outputs/") else Path(folder) / picture.makes
        shutil.copyfile(made, GALLERY / picture.file)
    remember(picture.file, digest(picture.sources))


def remember(file: str, found: str) -> None:
    """Write the digest of the picture ``file`` into the list."""
    text = LIST.read_text(encoding="utf-8")
    head = re.escape(f'["{file}"]')
    text, count = re.subn(rf'({head}\n(?:(?!\[").*\n)*?digest = )"[^"]*"', rf'\g<1>"{found}"', text)
    if count != 1:
        raise ValueError(f"{LIST}: no digest of {file}")
    LIST.write_text(text, encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; 1 where a picture is stale under ``--check`` or a name is not in the list."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.gallery", description=__doc__.splitlines()[0])
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="pictures, as two_cracks_phi_0.png (default: all stale)"
    )
    parser.add_argument("--check", action="store_true", help="say which are stale, make none")
    options = parser.parse_args(arguments)
    known = {picture.file: picture for picture in pictures()}
    unknown = [name for name in options.names if name not in known]
    if unknown:
        sys.stderr.write(f"no picture {', '.join(unknown)}; there are {', '.join(known)}\n")
        return 1
    chosen = [known[name] for name in options.names] or [picture for picture in known.values() if picture.stale]
    for picture in chosen:
        sys.stdout.write(f"{picture.file}: {'stale' if picture.stale else 'up to date'}: {picture.command}\n")
        sys.stdout.flush()
        if not options.check:
            make(picture)
    return int(options.check and any(picture.stale for picture in chosen))


if __name__ == "__main__":
    sys.exit(main())
