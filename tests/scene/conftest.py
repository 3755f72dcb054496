"""Write a scene into a temporary folder, load it, or collect its errors."""

from __future__ import annotations

from pathlib import Path

import pytest
from scene_texts import GOOD


@pytest.fixture
def scene_file(tmp_path):
    def write(text: str = GOOD, name: str = "scene.toml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def errors_of(scene_file):
    """The faults of the good scene with ``old`` replaced by ``new`` (pairs), and text added at the end."""
    from geomech.scene import SceneError, load_scene

    def collect(*changes: tuple[str, str], add: str = "", overrides=(), variant=None):
        text = GOOD
        for old, new in changes:
            assert text.count(old) >= 1, old
            text = text.replace(old, new, 1)
        with pytest.raises(SceneError) as caught:
            load_scene(scene_file(text + add), overrides, variant)
        return caught.value.errors

    return collect
