"""Rendering without a screen: which OpenGL window VTK can use here, found out without risking this process.

VTK segfaults where no OpenGL library can be loaded, so the first window is opened in a process of its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import lru_cache

#: What Debian and Ubuntu need for a machine without a screen.
APT_LINE = "apt-get install -y libegl1 libgl1 libgl1-mesa-dri libxrender1"

_PROBE = """
from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkRenderer
import vtkmodules.vtkRenderingOpenGL2
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.AddRenderer(vtkRenderer())
window.Render()
print(window.GetClassName(), flush=True)
"""


class RenderingUnavailable(RuntimeError):
    """No OpenGL window can be opened here; the message says which libraries would mend that."""


def ready() -> str:
    """Prepare this process for off-screen rendering, before the first picture: the VTK window class that works here.

    Raises RenderingUnavailable, with the line that installs what is missing."""
    window = usable_window()
    if window is None:
        raise RenderingUnavailable(
            f"VTK can open neither an EGL nor an OSMesa window on this machine. On Debian or Ubuntu: {APT_LINE}"
        )
    if not os.environ.get("DISPLAY"):
        os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = window
    return window


@lru_cache(maxsize=1)
def usable_window() -> str | None:
    """The first of the user's own choice, EGL and OSMesa that renders in a process of its own; None without any."""
    chosen = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    for window in dict.fromkeys(filter(None, (chosen, "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"))):
        environment = {**os.environ, "VTK_DEFAULT_OPENGL_WINDOW": window}
        environment.pop("DISPLAY", None)
        try:
            tried = subprocess.run(
                [sys.executable, "-c", _PROBE], env=environment, capture_output=True, text=True, timeout=60, check=False
            )
        except subprocess.TimeoutExpired:
            continue
        # VTK falls back to another class without a word, so what it says it opened is what counts.
        if tried.returncode == 0 and tried.stdout.split():
            return tried.stdout.split()[-1]
    return None
