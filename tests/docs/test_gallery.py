"""The gallery: every picture says how it is made, and none is older than what it is made from.

`python -m docs.generate.gallery` remakes what is stale.
"""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
from docs.generate import gallery  # noqa: E402

PICTURES = gallery.pictures()


def test_every_picture_says_how_it_is_made():
    listed = {picture.file for picture in PICTURES}
    assert listed == {path.name for path in gallery.GALLERY.glob("*.png")}
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("**/*.md")]
    shown = {name for page in pages for name in re.findall(r"outputs/gallery/(\w+\.\w+)\)", page.read_text("utf-8"))}
    assert shown and shown <= listed
    assert all(each.startswith("geomech ") for picture in PICTURES for each in picture.command.split(" && "))


@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture.file)
def test_no_picture_is_older_than_its_sources(picture):
    assert not picture.stale, f"python -m docs.generate.gallery {picture.file}"


def test_words_do_not_make_a_picture_stale_but_numbers_do():
    before = 'def side():\n    """The side."""\n    return 2.0  # m\n'
    assert gallery.meaning("a.py", before) == gallery.meaning("a.py", "def side():\n    return 2.0\n")
    assert gallery.meaning("a.py", before) != gallery.meaning("a.py", before.replace("2.0", "3.0"))
    assert gallery.meaning("a.toml", "# rock\nx = 1 # m\n") == gallery.meaning("a.toml", "x   = 1\n")
    assert gallery.meaning("a.toml", "x = 1\n") != gallery.meaning("a.toml", "x = 2\n")
    assert gallery.meaning("a.geo", "x = 1; // m\n") == gallery.meaning("a.geo", "x = 1;\n")


def test_a_picture_that_is_made_is_put_in_place_with_its_digest(tmp_path, monkeypatch):
    (tmp_path / "scene.toml").write_text("x = 1\n")
    folder = tmp_path / "gallery"
    folder.mkdir()
    entry = 'command = "geomech draw {out}"\nmakes = "a.png"\nsources = ["scene.toml"]\ndigest = ""\n'
    (folder / "gallery.toml").write_text(f'["a.png"]\n{entry}\n["b.png"]\n{entry}')
    monkeypatch.setattr(gallery, "ROOT", tmp_path)
    monkeypatch.setattr(gallery, "GALLERY", folder)
    monkeypatch.setattr(gallery, "LIST", folder / "gallery.toml")
    monkeypatch.setattr(
        gallery.subprocess, "run", lambda command, **_: (Path(command[-1]) / "a.png").write_text("drawn")
    )
    assert gallery.main(["--check"]) == 1
    assert gallery.main(["b.png"]) == 0
    assert [picture.stale for picture in gallery.pictures()] == [True, False]
    assert (folder / "b.png").read_text() == "drawn" and not (folder / "a.png").exists()
    (tmp_path / "scene.toml").write_text("x = 2\n")
    assert [picture.stale for picture in gallery.pictures()] == [True, True]
    assert gallery.main(["c.png"]) == 1
