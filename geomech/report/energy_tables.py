"""Energy budget of a run as tables for its page: of blocks and contacts, and of cracks."""

from __future__ import annotations

from collections.abc import Mapping

from .page import Page

#: Parts of the blocks' budget → their names.
BLOCKS = {
    "load_work": "work of loads",
    "gravity_work": "work of gravity",
    "elastic_energy": "elastic, in blocks",
    "contact_energy": "elastic, in contacts",
    "kinetic_energy": "kinetic",
    "crack_work": "given to cracks by the mean stress",
    "friction_loss": "friction",
    "damping_loss": "damping",
    "bond_loss": "broken bonds",
    "crushing_loss": "crushed faces",
    "impact_loss": "impacts",
    "scheme_loss": "time scheme",
    "carried_loss": "velocity carried over",
    "growth_release": "of the time scheme: released by growth at constant load",
    "overlap_energy": "overlaps",
    "split_energy": "of excavated blocks (which take it along) or cut ones",
    "energy_residual": "unexplained",
}
#: Source of the energy given to cracks …
GIVEN = {
    "crack_work": "from blocks, by their mean stress",
    "uneven_work": "from forces that open them by bending, act non-uniformly or are delayed",
    "set_free_energy": "released by blocks that split",
}
#: … and its use.
TAKEN = {
    "crack_elastic": "stored around cracks",
    "crack_friction": "friction of crack faces",
    "crack_bond_loss": "broken cement of crack faces",
    "fracture_energy": "new crack",
    "runaway_loss": "released by unstable growth in excess of the fracture energy",
    "parting_energy": "last ligaments, and block faces that were cracks",
    "excavated_crack_energy": "stored around cracks of excavated blocks, which take it along",
    "crack_residual": "unexplained",
}


def add_energy(page: Page, energy: Mapping[str, float]) -> None:
    """Tables of ``energy``, J/m, as in the run's summary; zero parts are left out."""
    done = abs(energy.get("load_work", 0.0) + energy.get("gravity_work", 0.0))
    _add(page, "energy", "% of the work done", [(label, energy.get(name)) for name, label in BLOCKS.items()], done)
    given = sum(energy.get(name, 0.0) for name in GIVEN)
    spent = [(label, energy.get(name)) for name, label in TAKEN.items()]
    if not any(value for _, value in spent):
        return
    rows = [(label, energy.get(name)) for name, label in GIVEN.items()]
    _add(page, "energy at cracks", "% of what was given", rows + spent, abs(given))
    sentences = []
    if energy.get("toughness_energy"):
        sentences.append(
            f"Fracture energy of all new cracks, K_Ic²/E' times length: {energy['toughness_energy']:.4g} J/m."
        )
    if energy.get("unpaid_toughness"):
        sentences.append(
            f"Of this, blocks did not supply {energy['unpaid_toughness']:.4g} J/m: blocks of order 1 store no bending "
            "energy, or the time step is longer than the growth."
        )
    if energy.get("budget_residual") is not None:
        sentences.append(
            f"Of all energy converted by blocks and cracks, {abs(energy['budget_residual']):.1e} is not accounted for."
        )
    page.text(*sentences)


def _add(page: Page, what: str, share: str, parts: list[tuple[str, float | None]], whole: float) -> None:
    rows = [[label, value, f"{100 * value / whole:.2f}" if whole else None] for label, value in parts if value]
    if rows:
        page.table([what, "J/m", share], rows)
