"""``geomech doctor``: missing parts of the installation, and how to add them."""

from __future__ import annotations

import argparse

from ..verb import DONE, FAILED, Verbs, add_verb


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    doctor = add_verb(
        verbs, "doctor", _doctor, "check this machine: libraries, caches; show how to install what is missing",
        "geomech doctor\ngeomech doctor --warm",
    )  # fmt: skip
    doctor.add_argument("--warm", action="store_true", help="compile the kernels that ordinary scenes use, in advance")


def _doctor(options: argparse.Namespace) -> int:
    from ...installing.doctor import examine

    if options.warm:
        from ...installing.doctor import warm
        from ..messages import report_compiling

        report_compiling()
        warm()
    checks = examine()
    for check in checks:
        print(f"{'ok  ' if check.good else 'FAIL'} {check.name:<12} {check.found}")
        if not check.good:
            print(f"     {'':<12} → {check.remedy}")
    return DONE if all(check.good for check in checks) else FAILED
