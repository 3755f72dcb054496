"""Part of a study's comparison: title, table and text, for the terminal and the page."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .page import Page, written
from .table import aligned


@dataclass(frozen=True)
class Part:
    """``rows`` are cells under ``headers``: text, numbers, None; ``before`` and ``after`` are sentences around the
    table."""

    title: str
    headers: Sequence[str] = ()
    rows: Sequence[Sequence[Any]] = ()
    before: Sequence[str] = ()
    after: Sequence[str] = ()

    def text(self) -> str:
        lines = [self.title, *_wrapped(self.before)]
        if self.rows:
            cells = [list(self.headers), *([written(cell) for cell in row] for row in self.rows)]
            lines += [f"  {line}" for line in aligned(cells).splitlines()]
        return "\n".join([*lines, *_wrapped(self.after)])

    def add_to(self, page: Page) -> None:
        page.section(self.title)
        page.text(*self.before)
        if self.rows:
            page.table(self.headers, self.rows)
        page.text(*self.after)


def _wrapped(paragraphs: Sequence[str]) -> list[str]:
    return [
        line for words in paragraphs for line in textwrap.wrap(words, 110, initial_indent="  ", subsequent_indent="  ")
    ]
