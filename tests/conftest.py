"""What tests of several folders share."""

import signal
from collections.abc import Iterator

import pytest


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
