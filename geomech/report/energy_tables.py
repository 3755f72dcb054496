"""The energy budget of a run as tables of its page: of blocks and contacts, and of cracks."""

from __future__ import annotations

from collections.abc import Mapping

from .page import Page

#: Parts of the blocks' budget → what they are called.
BLOCKS = {
    "load_work": "work of loads",
    "gravity_work": "work of gravity",
    "elastic_energy": "elastic, in blocks",
    "contact_energy": "elastic, in contacts",
    "kinetic_energy": "kinetic",
    "crack_work": "spent on cracks by the mean stress",
    "friction_loss": "friction",
    "damping_loss": "damping",
    "bond_loss": "broken bonds",
    "impact_loss": "impacts",
    "scheme_loss": "time scheme",
    "carried_loss": "velocity carried over",
    "growth_release": "of the time scheme: set free by growth at one load",
    "overlap_energy": "overlaps",
    "split_energy": "of blocks dug out (they take it along) or cut",
    "energy_residual": "unexplained",
}
#: Where what is spent on cracks comes from …
GIVEN = {
    "crack_work": "from blocks, by their mean stress",
    "uneven_work": "from forces that bend them open, press unevenly or wait for faces to give way",
    "set_free_energy": "set free by blocks that parted",
}
#: … and where it goes.
TAKEN = {
    "crack_elastic": "stored around cracks",
    "crack_friction": "friction of crack faces",
    "crack_bond_loss": "cement of crack faces that broke",
    "fracture_energy": "new crack",
    "runaway_loss": "released by unstable growth beyond what rock takes",
    "parting_energy": "last ligaments, and walls that were cracks",
    "crack_residual": "unexplained",
}


def add_energy(page: Page, energy: Mapping[str, float]) -> None:
    """Tables of ``energy``, J/m, as in the run's summary; parts that are zero are left out."""
    done = abs(energy.get("load_work", 0.0) + energy.get("gravity_work", 0.0))
    _add(page, "energy", "% of the work done", [(label, energy.get(name)) for name, label in BLOCKS.items()], done)
    given = sum(energy.get(name, 0.0) for name in GIVEN)
    spent = [(label, energy.get(name)) for name, label in TAKEN.items()]
    if not any(value for _, value in spent):
        return
    rows = [(label, energy.get(name)) for name, label in GIVEN.items()]
    _add(page, "energy at cracks", "% of what was given", rows + spent, abs(given))
    said = []
    if energy.get("toughness_energy"):
        said.append(f"Rock takes {energy['toughness_energy']:.4g} J/m, K_Ic²/E' of all new crack, as it breaks.")
    if energy.get("unpaid_toughness"):
        said.append(
            f"Of that blocks did not give {energy['unpaid_toughness']:.4g} J/m: they store no bending, and cracks that "
            "it opens take no energy from the motion."
        )
    if energy.get("budget_residual") is not None:
        said.append(
            f"Of all energy turned over, of blocks and cracks together, {abs(energy['budget_residual']):.1e} is not "
            "accounted for."
        )
    page.text(*said)


def _add(page: Page, what: str, share: str, parts: list[tuple[str, float | None]], whole: float) -> None:
    rows = [[label, value, f"{100 * value / whole:.2f}" if whole else None] for label, value in parts if value]
    if rows:
        page.table([what, "J/m", share], rows)
