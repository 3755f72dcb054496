"""Former names of arguments and attributes work for one version, with a warning."""

import math

import numpy as np
import pytest

from geomech import dda, ddm
from geomech.model import Blocks, Cracks, DdaSettings, DdmSettings, History, JointLaw, Joints, Loads, Material
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


def test_a_half_plane_and_what_a_body_reuses_are_taken_by_their_former_names():
    rock, crack = Material("rock", 1e10, 0.2), Cracks.from_polylines([np.array([[-1.0, -2.0], [1.0, -2.0]])])
    with pytest.warns(DeprecationWarning, match=r"Body\(half_plane=…\) is part of loops=… now"):
        body = ddm.Body([], crack, rock, half_plane=ddm.HalfPlane())
    assert body.half_plane == ddm.HalfPlane() == ddm.Body(ddm.HalfPlane(), crack, rock).half_plane
    with pytest.raises(ValueError, match="has an outline"):
        ddm.Body(SQUARE, crack, rock, half_plane=ddm.HalfPlane())
    with pytest.warns(
        DeprecationWarning, match=r"Body\(previous=…, work=…\) is now Body\(reuse=Reuse\(previous=…, work=…\)\)"
    ):
        again = ddm.Body(ddm.HalfPlane(), crack, rock, previous=body, work=body.work)
    assert again.work is body.work


def test_settings_of_growth_are_taken_by_position_still():
    rock, crack = Material("rock", 1e10, 0.2, k_ic=1e6), Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])])
    load = ddm.BodyLoad(remote_stress=[0, 1.0, 0])
    with pytest.warns(DeprecationWarning, match=r"propagate takes settings=… by its name now"):
        (step,) = ddm.propagate([], crack, rock, load, None, DdmSettings(order=3))
    assert step.solution.body.settings.order == 3


def test_which_joint_acts_is_said_by_a_function_still():
    base = np.array([[-1.0, -1.0], [2.0, -1.0], [2.0, 0.0], [-1.0, 0.0]])
    blocks = Blocks.from_polygons([[base], SQUARE], fixed=[True, False])
    laws = [JointLaw("never"), JointLaw("joint", math.radians(30))]
    loads = Loads(gravity=History.constant([0.0, -9.81]))
    given = [Material("rock", 1e10, 0.2, 2500.0)], laws, loads, DdaSettings(time_step=0.01), 0.02
    with pytest.warns(DeprecationWarning, match=r"run\(joint_index=…\) is part of joints=… now"):
        *_, former = dda.run(blocks, *given, joint_index=lambda a, b: 1)
    *_, now = dda.run(blocks, given[0], Joints(laws, lambda a, b: 1), *given[2:])
    assert np.array_equal(former.vertices, now.vertices) and set(now.contacts["law"].tolist()) <= {1}


def test_repairs_of_drawings_and_requests_for_pictures_are_found_by_their_former_names():
    from geomech import shapes
    from geomech.render.fields import draw

    with pytest.warns(DeprecationWarning, match=r"shapes\.Mend is now geomech\.shapes\.Repair"):
        assert shapes.Mend is shapes.Repair
    with pytest.warns(DeprecationWarning, match=r"draw\.Wish is now geomech\.render\.fields\.draw\.PictureRequest"):
        assert draw.Wish is draw.PictureRequest
    cutting = shapes.cut([shapes.Zone("rock", (SQUARE[0],))], [])
    with pytest.warns(DeprecationWarning, match=r"Cutting\.mends is now Cutting\.repairs"):
        assert cutting.mends is cutting.repairs
