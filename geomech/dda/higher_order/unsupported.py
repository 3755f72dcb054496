"""Features that blocks of higher order, and faces that crush, do not support yet, refused by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...model import AUTO_ORDER, HIGHEST_ORDER, Blocks, DdaSettings, JointLaw, Material


def refuse_unsupported(
    blocks: Blocks, materials: Sequence[Material], joints: Sequence[JointLaw], settings: DdaSettings
) -> None:
    """Raise ValueError for features of the model that ``blocks`` with orders above 1, or faces that crush, do not support."""
    order = np.ones(blocks.n_blocks, int) if blocks.order is None else np.asarray(blocks.order)
    if not (((order >= 1) & (order <= HIGHEST_ORDER)) | (order == AUTO_ORDER)).all():
        raise ValueError(f"the order of a block is 1 to {HIGHEST_ORDER}, got {order.min()} to {order.max()}")
    bends = (order != 1) & ~blocks.fixed
    cells = np.zeros(blocks.n_blocks, bool)
    if blocks.glued is not None:
        cells[blocks.vertex_block[np.asarray(blocks.glued).ravel()]] = True
        cells &= ~blocks.fixed
    bends |= cells
    crushing = next((law.name for law in joints if law.crushing_strength is not None), None)

    def refuse(which: np.ndarray, why: str) -> None:
        if crushing is not None and which is bends:
            raise ValueError(f"joint {crushing!r} has a crushing strength: {why}")
        if which.any():
            block = int(np.argmax(which))
            order_text = '"auto"' if order[block] == AUTO_ORDER else order[block]
            raise ValueError(f"{blocks.names[block]!r} has order {order_text}: {why}")

    refuse(cells & (order == 1), "cells glued to each other need an order from 2")
    refuse(bends & np.array([materials[m].rigid for m in blocks.material]), "a rigid block does not bend")
    if blocks.constrained is not None:
        refuse(bends & blocks.constrained.any(axis=1), "guided blocks of higher order are not supported yet")
    law = next((law for law in joints if not (law.straight or (crushing is None and _dilates_only(law)))), None)
    if law is not None:
        refuse(bends, f"nonlinear joint laws such as {law.name!r} are not supported with it yet")
    law = next(
        (law for law in joints if law.dilation_angle and None in (law.normal_stiffness, law.shear_stiffness)), None
    )
    if law is not None:
        # With penalty springs points of a face lose contact as it slides, and rise by different amounts.
        refuse(bends, f"joint {law.name!r}, which dilates, needs a stiffness of its own with it")
    law = next((law for law in joints if law.restitution is not None), None)
    if law is not None:
        refuse(bends, f"a coefficient of restitution, as {law.name!r} has, is not supported with it yet")
    beta, gamma = settings.newmark
    if settings.spectral_radius is not None or (settings.dynamic_factor > 0 and gamma != 2 * beta):
        refuse(bends, "it supports Newmark's scheme with γ = 2β only, the trapezoidal rule or Shi's")
    if settings.springs != "stiff":
        refuse(bends, 'its contacts must be stiff springs: leave dda.springs at "stiff"')
    if settings.contact != "penalty":
        refuse(bends, 'its contacts must be penalty springs or joints with a stiffness: leave dda.contact at "penalty"')


def _dilates_only(law: JointLaw) -> bool:
    """Whether ``law`` is straight but for its dilation."""
    return replace(law, dilation_angle=0.0, dilation_slip=float("inf")).straight
