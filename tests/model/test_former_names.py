"""Former names of arguments and attributes work for one version, with a warning."""

import math

import numpy as np
import pytest

from geomech import dda
from geomech.model import Blocks, JointLaw, Loads, Material
from geomech.model.former_names import renamed_argument

SQUARE = [np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])]


@renamed_argument("old", "new")
def doubled(new: float = 1.0) -> float:
    """Twice ``new``."""
    return 2.0 * new


def test_a_former_name_is_passed_on_with_a_warning():
    with pytest.warns(DeprecationWarning, match=r"doubled\(old=…\) is now doubled\(new=…\)"):
        assert doubled(old=3.0) == 6.0
    assert doubled() == 2.0 and doubled(3.0) == doubled(new=3.0) == 6.0
    with pytest.raises(TypeError, match="both 'new' and its former name 'old'"):
        doubled(old=1.0, new=2.0)


def test_constrained_unknowns_are_found_by_their_former_name():
    fixed = np.eye(6, dtype=bool)[:1]
    with pytest.warns(DeprecationWarning, match="constrained"):
        blocks = Blocks.from_polygons([SQUARE], held=fixed)
    with pytest.warns(DeprecationWarning, match=r"Blocks\.constrained"):
        assert np.array_equal(blocks.held, fixed) and np.array_equal(blocks.constrained, fixed)


def test_the_comparison_of_toes_is_asked_for_by_its_former_name():
    base = np.array([[-1.0, -1.0], [2.0, -1.0], [2.0, 0.0], [-1.0, 0.0]])
    blocks = Blocks.from_polygons([[base], SQUARE], fixed=[True, False])
    rock, joint = Material("rock", 1e10, 0.2, 2500.0, 1e6), JointLaw("joint", math.radians(30))
    loads = Loads()
    with pytest.warns(DeprecationWarning, match="compare="), pytest.raises(dda.NothingToReduce):
        dda.factor_of_safety(blocks, [rock], [joint], loads, reduce=["none"], compare_toes=False)


def test_arguments_that_are_gathered_in_a_record_are_taken_one_by_one_still():
    base = np.array([[-1.0, -1.0], [2.0, -1.0], [2.0, 0.0], [-1.0, 0.0]])
    blocks = Blocks.from_polygons([[base], SQUARE], fixed=[True, False])
    given = blocks, [Material("rock", 1e10, 0.2, 2500.0, 1e6)], [JointLaw("joint", math.radians(30))], Loads()
    gathered = r"reduce=….* is now factor_of_safety\(search=FactorSearch\(reduce=…\)\)"
    with pytest.warns(DeprecationWarning, match=gathered), pytest.raises(dda.NothingToReduce, match="'none'"):
        dda.factor_of_safety(*given, reduce=["none"])
    with pytest.raises(TypeError, match="both 'search' and reduce"):
        dda.factor_of_safety(*given, reduce=["none"], search=dda.FactorSearch())


def test_a_former_name_of_a_package_gives_the_present_one():
    with pytest.warns(DeprecationWarning, match=r"geomech\.dda\.ToldContacts is now geomech\.dda\.InheritedContacts"):
        assert dda.ToldContacts is dda.InheritedContacts
    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        dda.no_such_name  # noqa: B018
