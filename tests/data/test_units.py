"""Units agree with pint, and other texts are refused."""

import itertools

import pint
import pytest

from fricjax.data.readers.header import split_title
from fricjax.data.units import _PREFIXED, _PREFIXES, _UNPREFIXED, factor, si_unit, unit_of
from fricjax.errors import DataError
from tests.tables import check_rows

REGISTRY = pint.UnitRegistry()
# Names unknown to pint, or with another meaning there: "Grad" is its gigaradian and the German word for a degree.
OURS = {
    "Grad",
    "Nm",
    "uin",
    "Sek",
    "Sekunde",
    "Sekunden",
    "secs",
    "1",
    "lbs",
    "°",
    "degC",
    "°C",
    "celsius",
    "gf",
    "microinch",
}
OURS |= {"pounds", "ozf", "hr", "Å", "gn"}
QUOTIENTS = [
    "m/s", "mm/s^2", "N/m", "N s/m", "N*m*s/rad", "kg m^2", "kg*m**2/s^2", "1/s", "N m/rad", "um/N", "s^-1",
    "N s^2/m^2", "mN/um", "N/(m s)", "rad/s", "N/m^3",
]  # fmt: skip


def of_pint(text):
    base = REGISTRY.Quantity(1, text).to_base_units()
    symbols = {"meter": "m", "kilogram": "kg", "second": "s", "radian": "rad", "ampere": "A", "kelvin": "K"}
    return base.magnitude, {symbols[name]: power for name, power in base.unit_items()}


def test_a_unit_is_what_pint_says():
    def check(name):
        found = unit_of(name)
        scale, powers = of_pint(name)
        assert found is not None
        assert found.scale == pytest.approx(scale, rel=1e-14)
        assert found.powers == powers

    check_rows(check, [*sorted({*_UNPREFIXED, *_PREFIXED} - OURS), *QUOTIENTS])


def test_prefixes_are_those_of_pint():
    for prefix, base in itertools.product(_PREFIXES, ("m", "s", "N", "Hz")):
        if len(prefix) <= 2:
            found = unit_of(prefix + base)
            assert found is not None
            assert found.scale == pytest.approx(of_pint(prefix + base)[0], rel=1e-14), prefix + base
    assert si_unit("millimetre") == (1e-3, "m") and si_unit("microseconds") == (1e-6, "s")


WRITTEN = {
    "µm": (1e-6, "m"),
    "μm": (1e-6, "m"),
    "micron": (1e-6, "m"),
    "°": (0.017453292519943295, "rad"),
    "deg": (0.017453292519943295, "rad"),
    "Grad": (0.017453292519943295, "rad"),
    "arcsec": (4.84813681109536e-06, "rad"),
    "inch": (0.0254, "m"),
    "msec": (1e-3, "s"),
    "Sek.": (1.0, "s"),
    "s.": (1.0, "s"),
    "min": (60.0, "s"),
    "m²": (1.0, "m^2"),
    "s⁻¹": (1.0, "s^-1"),
    "N·s/m": (1.0, "kg s^-1"),
    "N.m": (1.0, "kg m^2 s^-2"),
    "Nm": (1.0, "kg m^2 s^-2"),
    "g": (1e-3, "kg"),
    "%": (0.01, ""),
}
OTHER_TEXTS = [
    "counts", "", "-", "x", "5", "1", "t", "m^^2", "m/", "/m", "m^99", "m^1.5", "(m", "m)", "((m))", "9**9**9**9**9 m",
    "m_s", "m\0", "_", "m" * 41, "furlong", "m" + " m" * 20, "fm^9 fm^9 fm^9 fm^9 fm^9", "0.1 um",
]  # fmt: skip


def test_units_as_people_write_them():
    found = {text: si_unit(text) for text in WRITTEN}
    assert found == {text: (pytest.approx(scale, rel=1e-14), unit) for text, (scale, unit) in WRITTEN.items()}


def test_other_texts_are_no_units():
    assert {text: si_unit(text) for text in OTHER_TEXTS} == dict.fromkeys(OTHER_TEXTS)


def test_what_is_refused_is_shown_in_brief():
    with pytest.raises(DataError) as caught:
        factor("m" * 5000, ("m",), "the displacement 'x' of run.csv")
    assert len(str(caught.value)) < 200 and "..." in str(caught.value)
    assert split_title("x / mm") == ("x", "mm", None) and split_title("F/furlong") == ("F/furlong", None, None)
