"""A self-contained HTML page of text, tables and pictures, for a phone, a desktop or paper.

Nothing is fetched: pictures are data in the page, and fonts are the reader's own. The only script is the player of
`geomech.player`; a content security policy blocks all others and all requests.
"""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from ..player.page import player, policy
from .table import is_number

#: Permissions of a page without a player: its own pictures.
_PLAIN = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
_KINDS = {".png": "image/png", ".svg": "image/svg+xml", ".gif": "image/gif", ".jpg": "image/jpeg"}
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="$policy">
<title>$title</title>
<style>
$style
</style>
</head>
<body>
<header>
<h1>$title</h1>
$lead
</header>
$contents
<main>
$body
</main>
</body>
</html>
""")

_STYLE = """\
:root { --ink: #1d2026; --soft: #5d636e; --line: #d9dade; --tint: #f4f5f6; --accent: #1f6f8b;
  --paper: #fff; color-scheme: light; }
:root[data-theme="dark"] { --ink: #e8e9ec; --soft: #a2a8b3; --line: #3a3e46; --tint: #1f2228; --accent: #6fc0dc;
  --paper: #16181c; color-scheme: dark; }
@media screen and (prefers-color-scheme: dark) {
  :root:not([data-theme="light"]) { --ink: #e8e9ec; --soft: #a2a8b3; --line: #3a3e46; --tint: #1f2228;
    --accent: #6fc0dc; --paper: #16181c; color-scheme: dark; }
}
@media print { :root[data-theme="dark"] { --ink: #1d2026; --soft: #5d636e; --line: #d9dade; --tint: #f4f5f6;
  --accent: #1f6f8b; --paper: #fff; } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0 auto; padding: 1.5rem 1.1rem 4rem; max-width: 62rem; color: var(--ink); background: var(--paper);
  font: 1rem/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 1.65rem; line-height: 1.2; margin: 0 0 .4rem; }
h2 { font-size: 1.2rem; line-height: 1.25; margin: 2.4rem 0 .6rem; padding-bottom: .25rem;
  border-bottom: 1px solid var(--line); }
p { margin: .5rem 0; max-width: 46rem; }
.lead { color: var(--soft); }
nav { margin: 1rem 0 0; font-size: .92rem; }
nav a { color: var(--accent); text-decoration: none; margin-right: 1rem; display: inline-block; }
.facts { display: grid; grid-template-columns: repeat(auto-fill, minmax(10.5rem, 1fr)); gap: .6rem;
  margin: 1rem 0; padding: 0; }
.facts div { background: var(--tint); border-radius: .35rem; padding: .5rem .7rem; }
.facts dt { color: var(--soft); font-size: .82rem; }
.facts dd { margin: 0; font-weight: 600; overflow-wrap: anywhere; }
.wide { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
caption { caption-side: top; text-align: left; color: var(--soft); padding: 0 0 .35rem; }
th, td { padding: .28rem .75rem .28rem 0; text-align: right; vertical-align: top;
  border-bottom: 1px solid var(--line); }
th { font-weight: 600; vertical-align: bottom; border-bottom: 1.5px solid var(--soft); }
th.words, td.words { text-align: left; }
td.long { text-align: left; min-width: 11rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, var(--least, 17rem)), 1fr));
  gap: 1rem; margin: 1rem 0; }
figure { margin: 0; min-width: 0; }
figure img { max-width: 100%; height: auto; display: block; background: #fff; border-radius: .3rem; }
.playing { width: min(96vw, 88rem); margin-left: 50%; transform: translateX(-50%); }
figcaption { color: var(--soft); font-size: .88rem; margin-top: .3rem; }
pre { background: var(--tint); border-radius: .35rem; padding: .7rem .9rem; overflow-x: auto; font-size: .85rem;
  line-height: 1.4; }
details { margin: .8rem 0; }
summary { cursor: pointer; color: var(--accent); }
td.bar { width: 40%; min-width: 6rem; padding-right: 0; vertical-align: middle; }
td.bar span { display: block; height: .7rem; border-radius: .15rem; background: var(--accent);
  print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.warning { border-left: 3px solid #c8553d; padding-left: .7rem; overflow-wrap: anywhere; }
@page { size: A4; margin: 16mm 15mm; }
@media print {
  .playing { width: auto; margin: 0; transform: none; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  nav, summary { display: none; }
  h2 { break-after: avoid; margin-top: 1.4rem; }
  figure, tr, .facts div { break-inside: avoid; }
  .wide { overflow: visible; }
  table { font-size: 8.5pt; }
  .figures { grid-template-columns: repeat(auto-fit, minmax(calc(.7 * var(--least, 17rem)), 1fr)); }
  pre { white-space: pre-wrap; }
}"""


class Page:
    """A page under construction: every method appends to it."""

    def __init__(self, title: str, lead: str = "") -> None:
        self.title = title
        self._lead = lead
        self._body: list[str] = []
        self._sections: list[str] = []
        self._plays = False

    def section(self, title: str) -> None:
        self._sections.append(title)
        self._body.append(f'<h2 id="s{len(self._sections)}">{html.escape(title)}</h2>')

    def text(self, *paragraphs: str) -> None:
        self._body += [f"<p>{html.escape(words)}</p>" for words in paragraphs]

    def warning(self, words: str) -> None:
        self._body.append(f'<p class="warning">{html.escape(words)}</p>')

    def facts(self, pairs: Mapping[str, Any]) -> None:
        """Name → value, as tiles; those without a value are left out."""
        tiles = [
            f"<div><dt>{html.escape(name)}</dt><dd>{html.escape(written(value))}</dd></div>"
            for name, value in pairs.items()
            if value is not None
        ]
        if tiles:
            self._body.append(f'<dl class="facts">{"".join(tiles)}</dl>')

    def table(self, headers: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "") -> None:
        """Each row is a sequence of cells: text, numbers, None. Columns of numbers are right-aligned."""
        rows = [list(row) for row in rows]
        words = [any(isinstance(row[k], str) and not is_number(row[k]) for row in rows) for k in range(len(headers))]
        long = [any(isinstance(row[k], str) and len(row[k]) > 40 for row in rows) for k in range(len(headers))]
        kinds = ["long" if is_long else "words" if is_text else "" for is_long, is_text in zip(long, words)]

        def line(tag: str, cells: Sequence[Any]) -> str:
            return "".join(
                f"<{tag}{_of('words' if tag == 'th' and kind else kind)}>{html.escape(written(cell))}</{tag}>"
                for kind, cell in zip(kinds, cells, strict=True)
            )

        title = f"<caption>{html.escape(caption)}</caption>" if caption else ""
        body = "\n".join(f"<tr>{line('td', row)}</tr>" for row in rows)
        self._body.append(
            f'<div class="wide"><table>{title}<thead><tr>{line("th", headers)}</tr></thead>\n'
            f"<tbody>{body}</tbody></table></div>"
        )

    def bars(self, headers: Sequence[str], sizes: Mapping[str, float]) -> None:
        """Name → size as a table with a bar each, the largest as long as its column."""
        most = max(sizes.values(), default=0.0) or 1.0
        rows = "\n".join(
            f'<tr><td class="words">{html.escape(name)}</td><td>{html.escape(written(size))}</td>'
            f'<td class="bar"><span style="width:{100 * size / most:.1f}%"></span></td></tr>'
            for name, size in sizes.items()
        )
        head = "".join(
            f"<th{_of('words' if k == 0 else '')}>{html.escape(name)}</th>" for k, name in enumerate(headers)
        )
        self._body.append(
            '<div class="wide"><table '
            f'style="width:100%"><thead><tr>{head}<th></th></tr></thead><tbody>{rows}</tbody></table></div>'
        )

    def figures(self, pictures: Iterable[tuple[Path, str]], least_rem: float = 17.0, whole: bool = False) -> None:
        """(file, caption) side by side as far as each keeps a width of ``least_rem``; ``whole``: one below the
        other."""
        size = "--least:100%" if whole else f"--least:{least_rem:g}rem"
        shown = [
            f'<figure><img alt="{html.escape(caption, quote=True)}" src="{_data(path)}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            for path, caption in pictures
        ]
        if shown:
            self._body.append(f'<div class="figures" style="{size}">{"".join(shown)}</div>')

    def play(self, records: Sequence[Mapping[str, Any]]) -> None:
        """The player of runs (`geomech.player.page.records_of`), wider than the text; at most one per page."""
        if self._plays:
            raise ValueError(f"{self.title}: a page can play its runs in one place only")
        self._plays = True
        self._body.append(f'<div class="playing">{player(records)}</div>')

    def code(self, text: str) -> None:
        self._body.append(f"<pre>{html.escape(text)}</pre>")

    def folded(self, summary: str, text: str) -> None:
        """``text`` verbatim, shown when ``summary`` is opened."""
        self._body.append(f"<details><summary>{html.escape(summary)}</summary><pre>{html.escape(text)}</pre></details>")

    def __str__(self) -> str:
        links = [f'<a href="#s{k}">{html.escape(name)}</a>' for k, name in enumerate(self._sections, 1)]
        return _PAGE.substitute(
            title=html.escape(self.title),
            style=_STYLE,
            policy=policy() if self._plays else _PLAIN,
            lead=f'<p class="lead">{html.escape(self._lead)}</p>' if self._lead else "",
            contents=f"<nav>{' '.join(links)}</nav>" if len(links) > 2 else "",
            body="\n".join(self._body),
        )

    def write(self, path: Path) -> Path:
        """Write the page to ``path``, atomically."""
        path.parent.mkdir(parents=True, exist_ok=True)
        partial_file = path.with_name(path.name + ".part")
        partial_file.write_text(str(self), encoding="utf-8")
        partial_file.replace(path)
        return path


def written(value: Any) -> str:
    """A cell: text unchanged, numbers with four digits, missing values as a dash."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f").replace("-", "−")
    if isinstance(value, float):
        mantissa, _, power = f"{value:.4g}".partition("e")
        return (mantissa + (f"·10{str(int(power)).translate(_RAISED)}" if power else "")).replace("-", "−")
    text = str(value)
    return text.replace("-", "−") if is_number(text) and text != "-" else text


def _of(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


def _data(path: Path) -> str:
    return f"data:{_KINDS[path.suffix.lower()]};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
