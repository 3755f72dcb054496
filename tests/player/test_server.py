"""The page of a run that goes on: what is new is sent once, and to nobody who should not have it."""

from __future__ import annotations

import json
import shutil
import socket
import urllib.error
import urllib.request

import pytest
import synthetic_run as made

from geomech.cli import BAD_INPUT, DONE, main
from geomech.output import Histories, Series, Summary
from geomech.player.server import PortInUse, Viewer


def ask(address: str, host: str | None = None) -> tuple[int, str]:
    request = urllib.request.Request(address, headers={} if host is None else {"Host": host})
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


@pytest.fixture
def viewer(run_folder):
    opened = Viewer([run_folder]).start()
    yield opened
    opened.close()


def test_the_page_and_its_news(viewer):
    code, page = ask(viewer.address)
    assert code == 200 and "Made-up specimen" in page and "connect-src &#x27;self&#x27;" in page.replace("'", "&#x27;")
    code, text = ask(viewer.address + "news?known=")
    (run,) = json.loads(text)["runs"]
    assert code == 200 and len(run["frames"]) == 7
    known = f"{len(run['frames'])},{len(run['meshes'])},{run['version']}"
    # Once the run stands, its pictures' magnification is worked out; then there is no more to say.
    json.loads(ask(viewer.address + f"news?known={known}")[1])
    (last,) = json.loads(ask(viewer.address + f"news?known={known}")[1])["runs"]
    assert last is None or last["frames"] == []
    assert ask(viewer.address + "history.csv")[0] == 404
    assert ask(viewer.address + "..%2f..%2fetc%2fpasswd")[0] == 404


def test_new_cycles_are_sent_as_they_come_and_another_run_begins_again(tmp_path):
    folder, watching = tmp_path / "run", [Histories(), Series(interior_every=0)]
    for observer in watching:
        observer.on_start(made.problem(), folder)
    cycles = made.cycles()
    viewer = Viewer([folder]).start()
    try:
        assert "has written no cycle yet" in viewer.news("")["waiting"]
        for observer in watching:
            observer.on_cycle(cycles[0])
            observer.on_cycle(cycles[1])
        (run,) = viewer.news("")["runs"]
        assert [frame["cycle"] for frame in run["frames"]] == [0, 1] and not run["ended"]
        known = f"2,{len(run['meshes'])},{run['version']}"
        assert viewer.news(known)["runs"] == [None]
        for observer in watching:
            observer.on_cycle(cycles[2])
        (run,) = viewer.news(known)["runs"]
        assert [frame["cycle"] for frame in run["frames"]] == [2] and run["meshes"] == []
        # Two readers, each of whom gets all of it.
        assert [frame["cycle"] for frame in viewer.news(known)["runs"][0]["frames"]] == [2]
        (folder / "scene.toml").write_text("title = 'again'")
        assert viewer.news(known) == {"began_again": True}
    finally:
        viewer.close()


def test_other_machines_need_the_token_and_other_names_are_refused(run_folder, viewer):
    assert viewer.token == "" and ask(viewer.address, host="127.0.0.1:1")[0] == 200
    # A page from elsewhere whose name leads here (DNS rebinding).
    assert ask(viewer.address, host="evil.example")[0] == 403
    opened = Viewer([run_folder], host="0.0.0.0").start()
    try:
        place = f"http://127.0.0.1:{opened.port}/"
        assert len(opened.token) > 20 and f"?token={opened.token}" in opened.address
        assert ask(place)[0] == 403 and ask(place + "news?known=")[0] == 403 and ask(place + "?token=no")[0] == 403
        code, page = ask(f"{place}?token={opened.token}")
        assert code == 200 and f"news?token={opened.token}" in page
        assert ask(f"{place}news?token={opened.token}&known=")[0] == 200
    finally:
        opened.close()


def test_bad_input_is_reported(run_folder, tmp_path, capsys):
    def refused(*arguments: str) -> str:
        assert main(["view", *arguments]) == BAD_INPUT
        return capsys.readouterr().err

    assert "holds no run: history.csv is missing" in refused(str(tmp_path))
    assert "give up to 4" in refused(*[str(run_folder)] * 5)
    assert "70000 is no port" in refused(str(run_folder), "--port", "70000")
    assert "is no address of this machine" in refused(str(run_folder), "--host", "192.0.2.1")
    assert "--megabytes" in refused(str(run_folder), "--out", str(tmp_path / "a.html"), "--megabytes", "0")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert f"port {port} is in use by another program; leave it out" in refused(
            str(run_folder), "--port", str(port)
        )
        with pytest.raises(PortInUse):
            Viewer([run_folder], port=port)
    shutil.copytree(run_folder, tmp_path / "empty")
    for pvd in (tmp_path / "empty").glob("*.pvd"):
        pvd.unlink()
    assert "nothing has been written" in refused(str(tmp_path / "empty"), "--out", str(tmp_path / "a.html"))


def test_a_page_without_a_server(run_folder, tmp_path, capsys):
    assert main(["view", str(run_folder.parent), "--out", str(tmp_path / "p.html")]) == DONE
    assert "page: " in capsys.readouterr().err and (tmp_path / "p.html").stat().st_size < 1_000_000


def test_a_run_that_has_ended_takes_its_pictures_magnification(tmp_path):
    made.write(tmp_path / "run", [Histories(), Series(interior_every=1), Summary()])
    viewer = Viewer([tmp_path / "run"])
    try:
        (first,) = viewer.news("")["runs"]
        known = f"{len(first['frames'])},{len(first['meshes'])},{first['version']}"
        (then,) = viewer.news(known)["runs"]
        from geomech.output import Run
        from geomech.player.recording import magnification

        assert then["frames"] == [] and then["scale"] == magnification(Run(tmp_path / "run"))
    finally:
        viewer._server.server_close()
