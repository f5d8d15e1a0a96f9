import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid.errors import DataError
from forceid.files.units import si_factor


@pytest.mark.parametrize(
    ("found", "expected", "factor"),
    [
        ("mm", "m", 1e-3),
        ("centimeters", "m", 1e-2),
        ("g", "kg", 1e-3),
        ("ms", "s", 1e-3),
        ("min", "s", 60.0),
        ("deg/s", "rad s-1", math.pi / 180),
        ("rpm", "rad s-1", 2 * math.pi / 60),
        ("rad/s", "Hz", 1 / (2 * math.pi)),
        ("g0", "m s-2", 9.80665),
        ("mm/s^2", "m s-2", 1e-3),
        ("gauss", "T", 1e-4),
        ("kg s-2 A-1", "T", 1.0),
        ("m s**-2", "m s-2", 1.0),
        ("kg·m²", "kg m2", 1.0),
        ("g cm2", "kg m2", 1e-7),
        ("N/mm", "N m-1", 1e3),
        ("N mm", "N m", 1e-3),
        ("N.mm", "N m", 1e-3),
        ("N-m", "N m", 1.0),
        ("Nm", "N m", 1.0),
        ("lbf", "kg m s-2", 4.4482216152605),
        ("lbf ft", "N m", 1.3558179483314004),
        ("lbs", "kg", 0.45359237),
        ("slug ft^2", "kg m2", 1.3558179483314004),
        ("km/h", "m s-1", 1 / 3.6),
        ("deg", "rad", math.pi / 180),
        ("%", "1", 1e-2),
        ("um/m", "1", 1e-6),
        ("dimensionless", "1", 1.0),
    ],
)
def test_convertible_units_become_si(found, expected, factor):
    assert si_factor(found, expected) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    ("found", "expected"), [("kg", "m"), ("Hz", "s"), ("1/s", "rad s-1"), ("parsnip", "m"), ("m2", "m")]
)
def test_other_units_are_refused_by_name(found, expected):
    with pytest.raises(DataError, match=r"a\.h5:/motion/x has units '.+', expected '.+'; "):
        si_factor(found, expected, "a.h5:/motion/x")


@pytest.mark.parametrize("unit", ["g", "G", "g0", "gn"])
def test_g_is_standard_gravity_of_an_acceleration_and_the_gram_of_a_mass(unit):
    assert si_factor(unit, "m s-2") == 9.80665
    assert si_factor("g", "kg") == 1e-3
    with pytest.raises(DataError, match="has units 'g', expected 'm'"):
        si_factor("g", "m")


@settings(deadline=None, derandomize=True)
@given(
    st.sampled_from(["mm", "cm", "ft", "km"]),
    st.sampled_from(["ms", "min"]),
    st.integers(1, 3),
    st.integers(1, 3),
)
def test_factors_of_products_multiply(length, time, p, q):
    whole = si_factor(f"{length}{p}/{time}^{q}", f"m{p} s-{q}")
    assert whole == pytest.approx(si_factor(length, "m") ** p / si_factor(time, "s") ** q, rel=1e-12)
