"""``geomech examples | new | schema``: starting points for new users."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ..verb import DONE, BadInput, Verbs, add_verb, check_writable


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    listed = add_verb(
        verbs, "examples", _examples, "list the examples installed with geomech, or copy one here",
        "geomech examples\ngeomech examples copy two_cracks\ngeomech run two_cracks",
    )  # fmt: skip
    listed.add_argument("what", nargs="?", choices=("list", "copy"), default="list", help="list (default) or copy")
    listed.add_argument("name", nargs="?", help="which example to copy")
    listed.add_argument("--to", type=Path, metavar="DIR", help="the new folder (default ./NAME)")
    begun = add_verb(
        verbs, "new", _new, "start a new scene: a commented scene.toml and its Gmsh model",
        "geomech new slope my_slope\ngeomech build my_slope\ngeomech safety my_slope",
    )  # fmt: skip
    begun.add_argument("kind", help="slope, specimen or tunnel")
    begun.add_argument("folder", type=Path, metavar="NAME", help="the new folder")
    schema = add_verb(
        verbs, "schema", _schema, "write the JSON schema of scenes, for completion and help in editors",
        "geomech schema --out scene.schema.json\n"
        '# then, as the first line of a scene: #:schema ./scene.schema.json',
    )  # fmt: skip
    schema.add_argument("--out", type=Path, metavar="FILE", help="output file (default: the standard output)")


def _examples(options: argparse.Namespace) -> int:
    from ...examples import ExampleError, copy, examples

    try:
        if options.what == "list":
            found = examples()
            width = max(len(example.name) for example in found)
            for example in found:
                print(f"{example.name:{width}}  {example.line}")
                if example.picture:
                    print(f"{'':{width}}  {example.picture}")
            print("\n`geomech run NAME` runs one into outputs/NAME; `geomech examples copy NAME` copies it here")
            return DONE
        if not options.name:
            raise BadInput("copy which example? `geomech examples` lists them")
        into = options.to or Path(options.name)
        files = copy(options.name, into)
    except ExampleError as error:
        raise BadInput(str(error)) from error
    print(f"{into}: {', '.join(map(str, files))}\nnext: geomech check {_to_run(into, files)}")
    return DONE


def _to_run(into: Path, files: list[Path]) -> Path:
    """The command that runs a copied example."""
    if {Path("scene.toml"), Path("run.py")} & set(files):
        return into
    return into / next(file for file in files if file.suffix == ".toml")


def _new(options: argparse.Namespace) -> int:
    from ...examples import ExampleError, new

    try:
        files = new(options.kind, options.folder)
    except ExampleError as error:
        raise BadInput(str(error)) from error
    model = options.folder / files[0]
    print(
        f"{options.folder}: {', '.join(map(str, files))}\n"
        f"next: geomech build {options.folder}    (draws its blocks; open {model} in Gmsh to change them)\n"
        f"      geomech run {options.folder}"
    )
    return DONE


def _schema(options: argparse.Namespace) -> int:
    check_writable("--out", options.out)
    from ...scene.keys import schema

    text = json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"
    if options.out is None:
        print(text, end="")
    else:
        options.out.write_text(text, encoding="utf-8")
        print(f"{options.out}: put `#:schema {options.out.name}` in the first line of a scene in the same folder")
    return DONE
