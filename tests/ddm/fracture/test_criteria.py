"""Growth criteria against closed forms and against the Williams field searched by brute force."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from geomech.ddm.fracture.criteria import CRITERIA, kink_factors
from geomech.model import Material

ROCK = Material("rock", 17e9, 0.21, k_ic=2e6)


def williams(theta, k_i, k_ii):
    """√(2πr) (σ_rr, σ_θθ, σ_rθ) ahead of a tip (Williams 1957), (3, ...)."""
    c, s = np.cos(theta / 2), np.sin(theta / 2)
    rr = k_i * c * (1 + s * s) + k_ii * s * (1 - 3 * s * s)
    tt = k_i * c**3 - 3 * k_ii * s * c * c
    rt = k_i * s * c * c + k_ii * c * (1 - 3 * s * s)
    return np.array([rr, tt, rt])


def mixed_loads(n=60, opening=False):
    rng = np.random.default_rng(7)
    k = rng.normal(size=(2, n)) * 1e6
    if opening:
        k[0] = np.abs(k[0])
    return k


@pytest.mark.parametrize("name", CRITERIA)
def test_pure_mode_one_goes_straight_on(name):
    angle, k_eq = CRITERIA[name]([2e6], [0.0], ROCK)
    assert angle[0] == 0.0
    assert k_eq[0] == pytest.approx(2e6, rel=1e-14)  # by definition of K_eq; round-off only


@pytest.mark.parametrize("name", CRITERIA)
def test_positive_mode_two_turns_clockwise_and_is_antisymmetric(name):
    k_i, k_ii = mixed_loads()
    k_ii = np.abs(k_ii)
    angle, k_eq = CRITERIA[name](k_i, k_ii, ROCK)
    mirrored, k_mirrored = CRITERIA[name](k_i, -k_ii, ROCK)
    assert (angle[k_eq > 0] < 0).all()
    np.testing.assert_allclose(mirrored, -angle, atol=1e-12)  # bisection ends within 1e-15 from either side
    np.testing.assert_allclose(k_mirrored, k_eq, rtol=1e-12)


@pytest.mark.parametrize("name", CRITERIA)
def test_no_drive_without_tension(name):
    angle, k_eq = CRITERIA[name](np.array([-1e6, 0.0]), np.zeros(2), ROCK)
    assert (angle == 0).all() and (k_eq == 0).all()


@pytest.mark.parametrize("name", CRITERIA)
def test_small_mode_two_turns_by_twice_the_ratio(name):
    """θ → −2 K_II/K_I: Cotterell & Rice (1980) for the hoop stress and G. For S, expand about θ = 0 with q = K_II/K_I:
    a11' = (3 − κ) θ and a12' = 3 − κ, so that S' = (3 − κ)(θ + 2q), the same for every κ < 3."""
    ratio = 1e-5
    angle, _ = CRITERIA[name]([1.0], [ratio], ROCK)
    assert angle[0] == pytest.approx(-2 * ratio, rel=1e-8)  # the next term is O(ratio²) smaller: 1e-10


def test_hoop_stress_in_pure_shear():
    """Erdogan & Sih (1963): −arccos(1/3) = −70.53°, K_eq = 2/√3 K_II."""
    angle, k_eq = CRITERIA["mts"]([0.0], [3e6], ROCK)
    assert angle[0] == pytest.approx(-math.acos(1 / 3), abs=1e-15)
    assert k_eq[0] == pytest.approx(2 / math.sqrt(3) * 3e6, rel=1e-14)


@pytest.mark.parametrize("nu", [0.0, 0.21, 0.4])
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_strain_energy_density_in_pure_shear(nu, plane):
    """Sih (1974): −arccos((1 − 2ν)/3), in plane stress with ν/(1 + ν)."""
    rock = Material("rock", 1e10, nu, plane=plane)
    angle, _ = CRITERIA["s"]([0.0], [1.0], rock)
    assert angle[0] == pytest.approx(-math.acos((1 - 2 * rock.effective_poissons_ratio) / 3), abs=1e-13)


def test_hoop_stress_is_the_largest_of_the_williams_field():
    k_i, k_ii = mixed_loads(200)
    angle, k_eq = CRITERIA["mts"](k_i, k_ii, ROCK)
    theta = np.linspace(-math.pi, math.pi, 20001)
    brute = williams(theta[:, None], k_i, k_ii)[1]
    at = brute.argmax(axis=0)
    assert (k_eq > 0).all()
    # A parabola through a grid of 3e-4 rad: the value is off by at most (h/2)²/2, the angle by h.
    np.testing.assert_allclose(k_eq, brute.max(axis=0), rtol=0, atol=2e-8 * np.hypot(k_i, k_ii).max())
    well_posed = k_eq > 1e-3 * np.hypot(k_i, k_ii)
    np.testing.assert_allclose(angle[well_posed], theta[at][well_posed], atol=2 * (theta[1] - theta[0]))
    # σ_rθ vanishes on the plane of largest hoop stress.
    shear = williams(angle, k_i, k_ii)[2]
    assert np.abs(shear).max() < 1e-14 * np.hypot(k_i, k_ii).max()


def test_hoop_stress_keeps_its_digits_under_strong_compression():
    """K_I < 0 is where the textbook formula cancels; mpmath has 40 digits to spare."""
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(40):
        for ratio in (1e-1, 1e-3, 1e-6):
            k_i, k_ii = mpmath.mpf(-1), mpmath.mpf(ratio)
            exact = 2 * mpmath.atan(-2 * k_ii / (k_i + mpmath.sqrt(k_i**2 + 8 * k_ii**2)))
            angle, _ = CRITERIA["mts"]([-1.0], [ratio], ROCK)
            assert angle[0] == pytest.approx(float(exact), rel=1e-15)


def test_strain_energy_density_is_the_energy_of_the_williams_field():
    """S of the three coefficients equals r × strain energy density of the field, and the angle is its local minimum."""
    k_i, k_ii = mixed_loads(40, opening=True)
    angle, k_eq = CRITERIA["s"](k_i, k_ii, ROCK)
    nu = ROCK.poissons_ratio

    def density(theta, a, b):
        rr, tt, rt = williams(theta, a, b)
        return ((1 - nu) * (rr**2 + tt**2) - 2 * nu * rr * tt + 2 * rt**2) / 2  # × 1/(2μ · 2πr)

    for a, b, theta, k in zip(k_i, k_ii, angle, k_eq):
        found = minimize_scalar(
            density, bounds=(theta - 0.1, theta + 0.1), args=(a, b), method="bounded", options={"xatol": 1e-10}
        )
        # A minimum is found by values to the root of the machine's epsilon only.
        assert theta == pytest.approx(found.x, abs=1e-6)
        assert k**2 == pytest.approx(density(theta, a, b) / density(0.0, 1.0, 0.0), rel=1e-12)
        assert williams(theta, a, b)[1] > 0


def test_kink_factors_hold_to_the_known_limits():
    """Cotterell & Rice (1980) for small kinks; k_2 of pure shear vanishes at 77.33° (Amestoy & Leblond 1992)."""
    theta = 1e-3
    c, s = math.cos(theta / 2), math.sin(theta / 2)
    c3, s3 = math.cos(1.5 * theta), math.sin(1.5 * theta)
    first_order = np.array([[3 * c + c3, -3 * (s + s3)], [s + s3, c + 3 * c3]]) / 4
    # Exact to first order only: the two differ by less than θ² (4/π² θ² in F22).
    np.testing.assert_allclose(kink_factors(theta), first_order, atol=theta**2)
    assert abs(kink_factors(math.radians(77.33))[1, 1]) < 2e-4  # half a unit of the printed angle's last digit
    np.testing.assert_allclose(kink_factors(0.0), np.eye(2))


def test_energy_release_rate_is_the_largest_over_opening_kinks():
    k_i, k_ii = mixed_loads(100, opening=True)
    angle, k_eq = CRITERIA["g"](k_i, k_ii, ROCK)
    theta = np.radians(np.linspace(-126, 126, 10081))
    k_1, k_2 = np.moveaxis(kink_factors(theta) @ np.array([k_i, k_ii]), 1, 0)
    g = np.where(k_1 > 0, k_1**2 + k_2**2, 0.0)
    np.testing.assert_allclose(k_eq**2, g.max(axis=0), rtol=1e-6)  # grid of 4e-4 rad, curvature of order one
    np.testing.assert_allclose(angle, theta[g.argmax(axis=0)], atol=2 * (theta[1] - theta[0]))


def test_energy_release_rate_and_local_symmetry_nearly_agree():
    """Under mixed opening loads the kink of largest G has k_2 ≈ 0 (Amestoy & Leblond 1992 find less than a degree)."""
    k_ii = np.linspace(0.0, 1.0, 21)
    angle, _ = CRITERIA["g"](np.ones(21), k_ii, ROCK)
    k = (kink_factors(angle) @ np.stack([np.ones(21), k_ii], axis=-1)[..., None])[..., 0]
    assert (np.abs(k[:, 1]) < 0.02 * k[:, 0]).all()


def test_open_slot_under_compression_kinks_sideways():
    """K_I < 0 and |K_II| of its size: 91° to 110° off the slot's line, in tension."""
    angle, k_eq = CRITERIA["mts"]([-0.0625, -0.0592], [-0.0585, -0.0602], ROCK)
    assert (np.degrees(angle) > 85).all() and (np.degrees(angle) < 110).all()
    assert (k_eq > 0).all()
    for name in ("g", "s"):
        turned, driven = CRITERIA[name]([-0.0625], [-0.0585], ROCK)
        assert turned[0] > math.radians(60) and driven[0] > 0


def test_bad_input_is_refused():
    for criterion in CRITERIA.values():
        with pytest.raises(ValueError, match="not finite"):
            criterion([1.0], [math.nan], ROCK)
        with pytest.raises(ValueError, match="one length"):
            criterion([1.0, 2.0], [1.0], ROCK)


def rock_with(shear_toughness):
    return Material("rock", 17e9, 0.21, k_ic=2e6, k_iic=shear_toughness)


def test_f_criterion_with_equal_toughnesses_is_the_energy_criterion():
    """G_I/G_c + G_II/G_c = G/G_c, wherever the energy criterion finds an opening kink."""
    k_i, k_ii = mixed_loads(200, opening=True)
    angle, k_eq = CRITERIA["f"](k_i, k_ii, rock_with(2e6))
    same, k_same = CRITERIA["g"](k_i, k_ii, ROCK)
    np.testing.assert_allclose(k_eq, k_same, rtol=1e-13)
    np.testing.assert_allclose(angle, same, atol=1e-12)


def test_f_criterion_tells_shear_from_tension_by_the_toughnesses():
    """Pure mode II. Straight on, F = (K_II/K_IIc)²; to the side, where k_2 vanishes, F = (1.23 K_II/K_Ic)²: at 77° by
    the expansion (75.6° where G is largest, 1.51 K_II²/E'). So a tip shears straight on below K_IIc = K_Ic/1.23."""
    tough, weak = rock_with(6e6), rock_with(1e6)
    angle, k_eq = CRITERIA["f"]([0.0], [1e6], tough)
    assert math.degrees(angle[0]) == pytest.approx(-76.5, abs=1.0) and k_eq[0] == pytest.approx(1.23e6, rel=5e-3)
    angle, k_eq = CRITERIA["f"]([0.0], [1e6], weak)
    assert angle[0] == pytest.approx(0.0, abs=1e-12) and k_eq[0] == pytest.approx(2e6, rel=1e-13)
    # Just at the toughness, whatever the criterion's name for it: F = 1.
    _, k_eq = CRITERIA["f"]([0.0, -3e6], [1e6, 1e6], weak)
    assert k_eq[1] >= k_eq[0] * (1 - 1e-12)  # a slot pressed together still shears
    turns = [float(CRITERIA["f"]([0.0], [1.0], rock_with(k))[1][0]) for k in (1e6, 1.5e6, 2e6, 4e6)]
    assert turns == sorted(turns, reverse=True)


def test_f_criterion_is_the_largest_f_of_all_kinks():
    """Against brute force over the expansion on a fine grid."""
    k_i, k_ii = mixed_loads(100)
    rock = rock_with(3e6)
    _, k_eq = CRITERIA["f"](k_i, k_ii, rock)
    theta = np.radians(np.linspace(-126, 126, 5041))
    k = np.einsum("tij,jn->itn", kink_factors(theta), np.stack([k_i, k_ii]))
    brute = np.hypot(np.maximum(k[0], 0.0), k[1] * 2 / 3)
    inside = (brute.argmax(axis=0) > 0) & (brute.argmax(axis=0) < len(theta) - 1)
    # The grid misses a maximum by less than 0.025°, of which the square counts.
    np.testing.assert_allclose(k_eq[inside], brute.max(axis=0)[inside], rtol=1e-6)
    assert inside.mean() > 0.9
