"""`geomech bench`: quick is held against quick only, what every part took is told, and other programs' time is not
counted."""

from __future__ import annotations

import json
import re
import time

import pytest

from geomech.bench import figures
from geomech.bench.figures import Measured
from geomech.cli import BAD_INPUT, DONE, main


@pytest.fixture
def one_topic(monkeypatch, tmp_path):
    """A benchmark of an error of 1e-3 and of 20 ms of work, in an empty folder."""

    def measure(quick: bool) -> Measured:
        spent_on = figures.stopwatch()
        while spent_on() < 0.02:
            pass
        return Measured.of("a table", errors={"k": 1e-3}, times={"t": 0.02})

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("geomech.cli.verbs.bench.topic", lambda name: measure)
    monkeypatch.setattr(figures, "yardstick", lambda: 0.1)
    return tmp_path


def test_quick_is_held_against_quick_and_full_against_full(one_topic, capsys):
    for options in ([], ["--quick"]):
        asked = ["bench", "many", *options]
        assert main([*asked, "--out", "before.json"]) == DONE
        assert main([*asked, "--against", "before.json"]) == DONE
        assert "less accurate: nothing" in capsys.readouterr().out
        other = ["--quick"] if not options else []
        assert main(["bench", "many", *other, "--against", "before.json"]) == BAD_INPUT
        assert "compare quick with quick" in capsys.readouterr().err


def test_every_part_s_time_and_the_whole_are_reported(one_topic, capsys):
    assert main(["bench", "many", "kernels", "--quick"]) == DONE
    said = capsys.readouterr().out
    rows = {name: float(own) for name, own in re.findall(r"^  (\w+) +[\d.]+ +([\d.]+)$", said, re.MULTILINE)}
    assert set(rows) == {"many", "kernels", "all"}
    spent = json.loads((one_topic / "outputs/bench/figures.json").read_text())["spent"]
    # The system counts a process's time in hundredths of a second.
    assert min(took["of processor"] for took in spent.values()) > 0.009
    assert rows["all"] == pytest.approx(sum(took["of processor"] for took in spent.values()), abs=0.06)


def test_waiting_is_not_counted():
    spent_on = figures.stopwatch()
    time.sleep(0.2)
    assert spent_on() < 0.1


def test_more_blocks_belong_to_the_block_solver(capsys):
    assert main(["bench", "ddm", "--blocks", "1000"]) == BAD_INPUT
    assert "geomech bench dda --blocks" in capsys.readouterr().err
