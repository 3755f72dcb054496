"""Random slopes whose factor of safety limit equilibrium knows, as the benchmark measures them."""

import pytest

from geomech.bench.safety import slope_factors


@pytest.mark.parametrize("seed", [16, 42, 52])
def test_a_face_open_at_one_end_keeps_its_cohesion_on_the_way_to_contact_states(seed):
    """Blocks that strain evenly part by a micrometre at one end of a plane; where the search for contact states took
    the bond of that end, factors came out 3 to 5 % low in silence. The benchmark calls right what is within 1 %."""
    assert slope_factors._row(seed)["verdict"] == "right"
