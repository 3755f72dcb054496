"""Unit of length in a STEP file."""

from __future__ import annotations

import re
from pathlib import Path

from .model_drawing import GmshModelError

#: Suffixes of shape files that contain their unit.
STEP = (".step", ".stp")
_SI_LENGTH = re.compile(r"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)")
_PREFIXES = {"": 1.0, "MILLI": 1e-3, "CENTI": 1e-2, "DECI": 0.1, "KILO": 1e3, "MICRO": 1e-6}
_OLD_LENGTHS = {"INCH": 0.0254, "FOOT": 0.3048}


def metres_in_step(path: Path) -> float:
    """Unit of length of a STEP file, m (ISO 10303-41: SI units with a prefix, or conversion-based ones)."""
    text = path.read_text(encoding="latin-1")
    for name, metres in _OLD_LENGTHS.items():
        if f"CONVERSION_BASED_UNIT('{name}'" in text.replace(" ", "").upper():
            return metres
    found = _SI_LENGTH.search(text)
    if found is None or (found[1] or "") not in _PREFIXES:
        raise GmshModelError(f"{path.name} has no unit of length", "export it again, in metres or millimetres")
    return _PREFIXES[found[1] or ""]
