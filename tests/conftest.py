"""What tests of several folders share: signals, and figures for the manual's verification pages."""

import fcntl
import json
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

# Processes that tests start load the package's 600 modules from bytecode, also where the user wants none written: half a
# second of each start.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# As the command line does, before NumPy is loaded: threads of each worker of pytest-xdist would wait for one another (crack
# solvers on two cores took six times as long).
for library in ("OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).parents[1]
#: Measured figures of the verification pages. `pytest --record-figures` writes those of the tests that it runs.
FIGURES = ROOT / "docs" / "verification" / "figures.json"
#: A test fails where an error is more than so many times the stored one, or less than the stored one by this factor:
#: then the pages are out of date. Errors below `ROUND_OFF` differ among machines.
WORSE, STALE, ROUND_OFF = 3.0, 10.0, 1e-9
RECORDED = pytest.StashKey[dict]()
FAILED = pytest.StashKey[bool]()


def pytest_addoption(parser) -> None:
    parser.addoption(
        "--record-figures", action="store_true", help=f"store what the tests measure in {FIGURES.relative_to(ROOT)}"
    )


def pytest_configure(config) -> None:
    config.stash[RECORDED] = {}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items) -> None:
    """Of a test marked `first_by_default(n)` the first n cases belong to the default suite; the others are slow."""
    seen: dict[tuple, int] = {}
    for item in items:
        if (marker := item.get_closest_marker("first_by_default")) is None:
            continue
        test = item.parent, item.originalname
        seen[test] = seen.get(test, 0) + 1
        if seen[test] > marker.args[0]:
            item.add_marker(pytest.mark.slow)


def pytest_sessionfinish(session) -> None:
    """Merge what was recorded into the file, locked because each worker of pytest-xdist ends with this."""
    if not (fresh := session.config.stash[RECORDED]):
        return
    FIGURES.touch()
    with FIGURES.open("r+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        stored = json.loads(file.read() or "{}")
        for module, tests in fresh.items():
            stored[module] = dict(sorted({**stored.get(module, {}), **tests}.items()))
        file.seek(0)
        file.truncate()
        file.write(json.dumps(dict(sorted(stored.items())), indent=1, ensure_ascii=False) + "\n")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if report.when == "call":
        item.stash[FAILED] = report.failed
    return report


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _agrees(now: float, stored: float) -> bool:
    return now <= max(WORSE * stored, ROUND_OFF) and stored <= max(STALE * now, ROUND_OFF)


@pytest.fixture
def verified(request) -> Iterator[Callable[..., None]]:
    """`verified(case, error, against)` states a figure of the manual's verification pages.

    case     what was computed, in words; unique within its test
    error    relative, or absolute in ``unit``; a sequence with ``over=(name, values)`` is a convergence study
    against  the closed form, published value or other method
    found    and ``exact``: computed and reference value in ``unit``, where these say more; ``error`` may be None then

    The figure is held against the stored one; with ``--record-figures`` it is stored instead.
    """
    record = request.config.getoption("--record-figures")
    module = Path(request.node.path).relative_to(ROOT).as_posix()
    mine: dict[str, dict] = {}

    def verify(
        case: str, error: float | Sequence[float] | None, against: str, *, found: float | None = None,
        exact: float | None = None, unit: str = "", over: tuple[str, Sequence[float]] | None = None,
    ) -> None:  # fmt: skip
        if error is None:
            error = abs(found / exact - 1)
        errors = [abs(float(e)) for e in ([error] if over is None else error)]
        assert all(map(math.isfinite, errors)) and case not in mine
        row: dict = {"against": against, "errors": [_rounded(e, 3) for e in errors]}
        if unit:
            row["unit"] = unit
        if found is not None:
            row |= {"found": _rounded(found, 6), "exact": _rounded(exact, 6)}
        if over is not None:
            row["over"], row["at"] = over[0], [float(x) for x in over[1]]
            assert len(row["at"]) == len(errors) > 1
        mine[case] = row

    yield verify
    if request.node.stash.get(FAILED, True):
        return
    assert mine, "a test that takes `verified` states at least one figure"
    if record:
        slow = request.node.get_closest_marker("slow") is not None
        tests = request.config.stash[RECORDED].setdefault(module, {})
        tests[request.node.name] = {"slow": slow, "cases": mine}
        return
    stored = json.loads(FIGURES.read_text(encoding="utf-8")).get(module, {}).get(request.node.name, {"cases": {}})
    renew = f"renew them with `pytest --record-figures '{request.node.nodeid}'` if the change is meant"
    assert set(stored["cases"]) == set(mine), f"the stored figures are of other cases: {renew}"
    for case, row in mine.items():
        before = stored["cases"][case]
        assert {k: v for k, v in before.items() if k not in ("errors", "found", "exact")} == {
            k: v for k, v in row.items() if k not in ("errors", "found", "exact")
        }, f"{case}: the words have changed: {renew}"
        agree = [_agrees(a, b) for a, b in zip(row["errors"], before["errors"], strict=True)]
        assert all(agree), f"{case}: errors {row['errors']}, stored {before['errors']}: {renew}"


def _taken_as(disposition) -> Iterator[None]:
    before = signal.signal(signal.SIGINT, disposition)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Ctrl-C (SIGINT) interrupts this process and those it starts, as in a terminal, also where whoever started the
    tests ignores it."""
    yield from _taken_as(signal.default_int_handler)


@pytest.fixture
def in_the_background() -> Iterator[None]:
    """Ctrl-C (SIGINT) is ignored, by this process and those it starts, as after ``&`` in a shell script."""
    yield from _taken_as(signal.SIG_IGN)
