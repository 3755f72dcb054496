"""A run says where the loads of cracked blocks are out of balance by more than strain explains."""

from __future__ import annotations

import logging
from types import SimpleNamespace

from geomech.coupling.load_transfer.load_imbalance import BEYOND, LoadBalance


def test_the_worst_block_is_named_when_it_passes_what_strain_allows_and_when_it_doubles(caplog):
    blocks, balance = SimpleNamespace(names=["base", "rock 1", "rock 2"]), LoadBalance()

    def told(*imbalance: float, strain: float = 0.0) -> list[str]:
        caplog.clear()
        loads = {b + 1: SimpleNamespace(imbalance=value) for b, value in enumerate(imbalance)}
        with caplog.at_level(logging.WARNING):
            balance.check(loads, blocks, strain, 0.5)
        return [record.getMessage() for record in caplog.records]

    assert not told() and not told(0.9 * BEYOND, 0.0)
    assert not told(4e-4, 0.0, strain=5e-4)  # strained corners, contacts pressed in
    (line,) = told(2e-5, 6e-4)
    assert "rock 2" in line and "6.0e-04" in line
    assert not told(1.1e-3, 0.0)  # that was said
    (line,) = told(1.3e-3, 0.0)
    assert "rock 1" in line
