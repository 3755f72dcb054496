"""The player as a self-contained HTML page: style, script and data.

The content security policy of the page names the script by its hash, so that no other script runs in it. Data are not
script but text that is parsed as JSON, and all texts of a run are inserted as text, never as markup.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from ..output.reading import Run
from .recording import BUDGET, NothingToPlay, Recording

#: Largest number of runs side by side: more would be too small.
MOST_RUNS = 4

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; --paper: #fff; --words: #1d2026; --quiet: #5d636e; }}
:root[data-theme="dark"] {{ --paper: #16181c; --words: #e8e9ec; --quiet: #a2a8b3; }}
@media (prefers-color-scheme: dark) {{ :root:not([data-theme="light"]) {{ --paper: #16181c; --words: #e8e9ec; --quiet: #a2a8b3; }} }}
@media print {{ :root {{ --paper: #fff !important; --words: #1d2026 !important; }} }}
body {{ margin: 0 auto; padding: .8rem 1rem 2rem; max-width: 96rem; background: var(--paper); color: var(--words);
  font: 1rem/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }}
h1 {{ font-size: 1.25rem; line-height: 1.25; margin: 0; }}
.lead {{ color: var(--quiet); margin: .1rem 0 0; font-size: .9rem; overflow-wrap: anywhere; }}
</style>
</head>
<body>
<header><h1>{title}</h1><p class="lead">{lead}</p></header>
{player}
</body>
</html>
"""


@cache
def script() -> str:
    """The player's script, its parts in the order of their numbers."""
    parts = sorted((part for part in _web().iterdir() if part.name.endswith(".js")), key=lambda part: part.name)
    body = "\n".join(part.read_text(encoding="utf-8").replace('"use strict";\n', "", 1) for part in parts)
    return f'"use strict";\n(() => {{\n{body}\n}})();\n'


@cache
def style() -> str:
    """The player's style sheet."""
    return (_web() / "player.css").read_text(encoding="utf-8")


def _web() -> Any:
    return resources.files(__package__) / "web"


def policy(connect: str = "'none'") -> str:
    """The content security policy of a page with the player: its own script, styles and pictures, and ``connect`` as
    the only address that it may request."""
    digest = base64.b64encode(hashlib.sha256(script().encode()).digest()).decode("ascii")
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data: blob:; "
        f"connect-src {connect}; base-uri 'none'; form-action 'none'"
    )


def player(records: Sequence[Mapping[str, Any]] | None = None, live: str | None = None) -> str:
    """HTML of the player, for the body of a page, with the ``records`` (`Recording.whole`), or with those served at the
    address ``live``."""
    attribute = f' data-live="{html.escape(live, quote=True)}" class="gm-alone"' if live else ""
    data = "" if records is None else f'<script type="application/json" id="geomech-runs">{_json(records)}</script>\n'
    return (
        f'<style>\n{style()}</style>\n<div id="geomech-player"{attribute}><noscript>The run plays in a browser that runs '
        f"scripts.</noscript></div>\n{data}<script>{script()}</script>"
    )


def _json(records: Any) -> str:
    """JSON inside a script element: no tag can end it, and numbers that JSON does not have become null."""
    text = json.dumps(records, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def records_of(runs: Iterable[Run], budget: int = BUDGET) -> list[dict[str, Any]]:
    """Records of up to `MOST_RUNS` playable ``runs``, in ``budget`` bytes together."""
    shown = []
    for run in runs:
        try:
            shown.append(Recording(run))
        except NothingToPlay:
            continue
        if len(shown) == MOST_RUNS:
            break
    return [each.whole(budget // len(shown)) for each in shown]


def whole_page(title: str, lead: str, body: str, connect: str = "'none'") -> str:
    """A complete page with a `player`."""
    return _PAGE.format(title=html.escape(title), lead=html.escape(lead), player=body, policy=policy(connect))


def write_player(runs: Sequence[Run], path: Path, budget: int = BUDGET) -> Path:
    """Write the page that plays ``runs`` to ``path``. Raises NothingToPlay if none of them can be drawn."""
    records = records_of(runs, budget)
    if not records:
        raise NothingToPlay(
            f"{', '.join(str(run.folder) for run in runs)}: nothing has been written that could be drawn"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    partial_file = path.with_name(path.name + ".part")
    partial_file.write_text(whole_page(records[0]["title"], lead_of(records), player(records)), encoding="utf-8")
    partial_file.replace(path)
    return path


def lead_of(records: Sequence[dict[str, Any]]) -> str:
    """One line below the title."""
    shown = [f"{r['name']}: {len(r['frames'])} of {r['of']} cycles" for r in records]
    return "; ".join(shown) + "; ? lists the keys"
