"""All generated pages, rewritten if their text has changed."""

from __future__ import annotations

from pathlib import Path

from . import command_line, equations, messages, output_files, scene_keys, verification

ROOT = Path(__file__).parents[2]
#: Files at the top of the project that are pages of the manual too.
PROJECT = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}


def write_all(folder: Path) -> None:
    """Write every generated page into ``folder``."""
    folder.mkdir(exist_ok=True)
    pages = {
        "scene_keys.md": scene_keys.page(),
        "command_line.md": command_line.page(),
        "output_files.md": output_files.page(),
        "equations.md": equations.page(),
        "all_messages.md": messages.page(),
        **verification.pages(),
    }
    pages |= {
        name: (ROOT / source).read_text(encoding="utf-8")
        for source, name in PROJECT.items()
        if (ROOT / source).is_file()
    }
    for old in folder.glob("*.md"):
        if old.name not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for file, chapter in verification.pictures():
        if not (folder / file).is_file() or (folder / file).stat().st_mtime < verification.MEASURED.stat().st_mtime:
            verification.draw(chapter, folder / file)
