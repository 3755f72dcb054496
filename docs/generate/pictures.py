"""Pictures that a tutorial writes as files (`geomech.render.draw`, `geomech build`), shown where they were made."""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

SUFFIXES = (".png", ".gif")


class RunPictures:
    """A scraper of sphinx-gallery: every PNG or GIF that the code above wrote, since this build began, into its working
    folder (``geomech-tutorial-…`` below the system's folder for temporary files) in a subfolder called ``shown``,
    once."""

    def __init__(self) -> None:
        self.seen: set[Path] = set()
        self.began = time.time()

    def __repr__(self) -> str:
        # Sphinx compares settings by their text.
        return "RunPictures"

    def __call__(self, block: Any, variables: dict[str, Any], settings: dict[str, Any]) -> str:
        from sphinx_gallery.scrapers import figure_rst

        root = Path(tempfile.gettempdir())
        made = [
            path
            for path in root.glob("geomech-tutorial-*/shown/*")
            if path.suffix in SUFFIXES and path not in self.seen and path.stat().st_mtime >= self.began
        ]
        shown = []
        for path in sorted(made, key=lambda path: path.stat().st_mtime_ns):
            self.seen.add(path)
            target = Path(next(variables["image_path_iterator"])).with_suffix(path.suffix)
            shutil.copyfile(path, target)
            shown.append(str(target))
        return figure_rst(shown, settings["src_dir"]) if shown else ""
