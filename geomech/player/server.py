"""`geomech view`: serves a page that plays runs, also while they are running, to a browser on the same machine.

The server has two addresses: the page, and the data that its runs have written since the last request. It listens on
the loopback interface; ``--host`` opens it to others, and every request must then carry a token. Requests that name
another host than the server was opened for are rejected, so that no foreign page can reach it under a name of its own
(DNS rebinding).
"""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import json
import secrets
import socket
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from ..output.reading import Run
from .page import player, policy, whole_page
from .recording import MOST_FRAMES, NothingToPlay, Recording, evenly, magnification, quick_magnification

#: Largest size of the cycles of one run in the browser, bytes of text.
LIVE_BUDGET = 48_000_000
#: Longest time of one answer, s: then the data read so far are sent, and the rest with the next answer.
_PATIENCE = 1.5


class PortInUse(OSError):
    """The port is used by another program."""


@dataclass
class Watched:
    """A run that may be in progress. ``frames`` and ``meshes`` were read so far, in the order in which they are sent."""

    folder: Path
    frames: list[dict[str, Any]] = field(default_factory=list)
    recording: Recording | None = None
    generation: int = 0
    version: int = 0
    more: bool = False
    _began: float | None = None
    _bytes: int = 0
    _written: tuple[float, bool] | None = None
    _scale: float | None = None

    def refresh(self) -> None:
        """Read new data; a run that was started again is read from its beginning."""
        run = Run(self.folder)
        scene, history = self.folder / "scene.toml", self.folder / "history.csv"
        # A run rewrites its scene at its start, and its history in every cycle.
        began = scene.stat().st_mtime if scene.is_file() else 0.0
        written = history.stat().st_mtime, (self.folder / "summary.json").is_file()
        if written != self._written:
            self._written = written
            self.version += 1
        if self._began is not None and began != self._began:
            self.frames, self.recording, self._bytes, self._scale = [], None, 0, None
            self.generation += 1
        self._began = began
        if self.recording is None:
            try:
                self.recording = Recording(run)
            except NothingToPlay:
                return
        else:
            self.recording.run = self.recording.frames.run = run
        cycles = [number for number in self.recording.cycles(every=True) if number > self.last]
        self.more = False
        if not cycles:
            if self.frames and run.summary and self._scale is None:
                # This takes seconds, so it is left out once the run is shown.
                self._scale = magnification(run)
                self.version += 1
            return
        left = LIVE_BUDGET - self._bytes
        each = self._bytes / len(self.frames) if self.frames else 0.0
        room = min(MOST_FRAMES * 2 - len(self.frames), int(left / each) if each else MOST_FRAMES)
        deadline = time.monotonic() + _PATIENCE
        for number in evenly(run, cycles, room) if room >= 2 else cycles[-1:]:
            self.frames.append(record := self.recording.frame(number))
            self._bytes += len(record["data"])
            if time.monotonic() > deadline:
                self.more = True
                break

    @property
    def last(self) -> int:
        """The last cycle that was read."""
        return int(self.frames[-1]["cycle"]) if self.frames else -1

    def answer(self, frames: int, meshes: int, version: int) -> dict[str, Any] | None:
        """New data for a reader who has this many frames and meshes, and the curves of ``version``; None if there are
        none."""
        assert self.recording is not None
        if frames >= len(self.frames) and version == self.version and frames:
            return None
        record: dict[str, Any] = {
            "frames": self.frames[frames:],
            "meshes": self.recording.frames.meshes[meshes:],
            "version": self.version,
        }
        if not frames:
            record |= self.recording.opening() | {"of": len(self.frames)}
        scale = quick_magnification(self.recording.run, self.last) if self._scale is None else self._scale
        return record | self.recording.state(scale)


class Viewer:
    """Serves the page of ``folders`` at ``host`` and ``port`` (0: any free one). Raises PortInUse, FileNotFoundError if
    a folder contains no run, and OSError for a host that is not this machine."""

    def __init__(self, folders: Sequence[Path], host: str = "127.0.0.1", port: int = 0) -> None:
        self.watched = [Watched(Path(folder)) for folder in folders]
        runs = [Run(each.folder) for each in self.watched]
        self.title = runs[0].title if len(runs) == 1 else "Runs side by side"
        self.local = _is_loopback(host)
        self.token = "" if self.local else secrets.token_urlsafe(16)
        self._lock = threading.Lock()
        try:
            self._server = _server_class(host)((host, port), _handler(self))
        except OSError as error:
            if error.errno in (98, 48, 10048):
                raise PortInUse(f"port {port} is in use by another program") from None
            raise
        self.host, self.port = host, int(self._server.server_address[1])

    @property
    def address(self) -> str:
        """Address of the page for a browser."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        if self.host in ("0.0.0.0", "::"):
            name = socket.gethostname()
        return f"http://{name}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    def serve(self) -> None:
        """Answer requests until `close` or an interrupt."""
        self._server.serve_forever(poll_interval=0.2)

    def start(self) -> Viewer:
        """Answer requests in the background; for notebooks and tests."""
        threading.Thread(target=self.serve, daemon=True, name="geomech view").start()
        return self

    def close(self) -> None:
        """Stop answering and release the port."""
        self._server.shutdown()
        self._server.server_close()

    def page(self) -> str:
        """The page; its data come from `news`."""
        live = f"news?token={self.token}" if self.token else "news?"
        names = ", ".join(str(each.folder) for each in self.watched)
        return whole_page(self.title, f"{names} · new cycles appear by themselves · ? lists the keys",
                          player(live=live), connect="'self'")  # fmt: skip

    def news(self, known: str) -> dict[str, Any]:
        """New data for a reader who has ``known`` ("frames,meshes,version;…" for each run)."""
        with self._lock:
            before = [each.generation for each in self.watched]
            for each in self.watched:
                each.refresh()
            empty = [each for each in self.watched if not each.frames]
            if empty:
                return {"waiting": f"{empty[0].folder} has written no cycle yet; waiting for it …"}
            counts = _counts(known, len(self.watched))
            again = before != [each.generation for each in self.watched]
            if again or any(n[0] > len(each.frames) for n, each in zip(counts, self.watched, strict=True)):
                return {"began_again": True}
            runs = [each.answer(*n) for each, n in zip(self.watched, counts, strict=True)]
            return {"runs": runs, "more": any(each.more for each in self.watched)}

    def allows(self, host: str, given: str) -> bool:
        """Whether a request that names ``host`` and carries the token ``given`` is answered."""
        if self.token:
            return hmac.compare_digest(given.encode(), self.token.encode())
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or _is_loopback(name)


def _counts(known: str, n: int) -> list[tuple[int, int, int]]:
    """The numbers in "frames,meshes,version;…"; zeros if the text has another form."""
    found = [tuple(int(part) if part.isdecimal() else -1 for part in each.split(",")) for each in known.split(";")]
    fitting = len(found) == n and all(len(each) == 3 and min(each) >= 0 for each in found)
    return [(a, b, c) for a, b, c in found] if fitting else [(0, 0, 0)] * n


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _server_class(host: str) -> type[ThreadingHTTPServer]:
    class Server(ThreadingHTTPServer):
        daemon_threads = True
        allow_reuse_address = False
        address_family = socket.AF_INET6 if ":" in host else socket.AF_INET

    return Server


def _handler(viewer: Viewer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            address = urlsplit(self.path)
            asked = parse_qs(address.query)
            if not viewer.allows(self.headers.get("Host", ""), asked.get("token", [""])[0]):
                return self.say(
                    403,
                    "text/plain",
                    "This address is not open to you: it takes the token that `geomech view` printed.",
                )
            if address.path == "/":
                return self.say(200, "text/html", viewer.page())
            if address.path == "/news":
                try:
                    found = viewer.news(asked.get("known", [""])[0])
                except FileNotFoundError as error:
                    return self.say(404, "text/plain", str(error))
                return self.say(200, "application/json", json.dumps(found, allow_nan=False))
            return self.say(404, "text/plain", "There is the page (/), and nothing else.")

        def say(self, code: int, kind: str, text: str) -> None:
            body = text.encode()
            self.send_response(code)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Referrer-Policy", "no-referrer")
            if kind == "text/html":
                self.send_header("Content-Security-Policy", policy("'self'") + "; frame-ancestors 'self'")
            self.end_headers()
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # the reader has gone
                self.wfile.write(body)

        def log_message(self, format: str, *arguments: Any) -> None:
            pass  # a line a second would bury what the terminal says

    return Handler


__all__ = ["PortInUse", "Viewer", "Watched"]
