"""Random slopes whose factor of safety limit equilibrium knows, as the benchmark measures them."""

import pytest

from geomech.bench.safety import factor_cost, slope_factors


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("seed", [16, 42, 52])
def test_a_face_open_at_one_end_keeps_its_cohesion_on_the_way_to_contact_states(seed):
    """Blocks that strain evenly part by a micrometre at one end of a plane; where the search for contact states took
    the bond of that end, factors came out 3 to 5 % low in silence. The benchmark calls right what is within 1 %."""
    assert slope_factors._row(seed)["verdict"] == "right"


def test_the_cost_of_a_search_is_printed_beside_its_error(monkeypatch):
    monkeypatch.setattr(factor_cost, "SIZES", {20: 4.0})
    found = factor_cost.measure_cost()
    errors = [figure.value for figure in found.figures if figure.name == "factor, 20 blocks"]
    assert len(errors) == 1 and errors[0] < 1e-3 and "seconds" in found.text
