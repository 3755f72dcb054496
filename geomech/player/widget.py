"""The player in a notebook: its page in a frame, which also works in an exported notebook."""

from __future__ import annotations

import html
from collections.abc import Sequence
from functools import cached_property

from ..output.reading import Run
from .page import lead_of, player, records_of, whole_page
from .recording import NothingToPlay


class RunPlayer:
    """Notebook display of ``runs``, ``height`` pixels high, in a page of about ``megabytes``.

    Raises NothingToPlay if none of them has written anything that can be drawn.
    """

    def __init__(self, runs: Sequence[Run], height: int = 860, megabytes: float = 4.0) -> None:
        self.height = int(height)
        records = records_of(runs, int(1e6 * megabytes))
        if not records:
            raise NothingToPlay(
                f"{', '.join(str(run.folder) for run in runs)}: nothing has been written that could be drawn"
            )
        self._records = records

    @cached_property
    def page(self) -> str:
        """The page as self-contained HTML."""
        return whole_page(self._records[0]["title"], lead_of(self._records), player(self._records))

    def _repr_html_(self) -> str:
        # Scripts run inside the frame only, without access to the notebook.
        return (
            f'<iframe srcdoc="{html.escape(self.page, quote=True)}" sandbox="allow-scripts allow-downloads" '
            f'style="width:100%;height:{self.height}px;border:0" title="{html.escape(self._records[0]["title"], quote=True)}">'
            "</iframe>"
        )

    def __repr__(self) -> str:
        names = ", ".join(record["name"] for record in self._records)
        return f"<player of {names}: in a notebook it plays; `geomech view` shows it in a browser>"
