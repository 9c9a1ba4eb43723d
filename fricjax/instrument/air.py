"""Refractive index of moist air.

The index gives the wavelength of a laser in air, and with it the length of a fringe. Source: P. E. Ciddor, Applied
Optics 35 (1996) 1566. Dry air and water vapour contribute to the index in proportion to their densities, which follow
from the equation of state of the BIPM (Davis 1992). Coefficients have the names of the paper.
"""

import math

from ..errors import UsageError
from ..numbers import number

EQUATION_STD = 2e-8
"""Standard uncertainty of the equation itself [1]; the paper claims a few parts in 10^8."""
_ZERO_CELSIUS = 273.15  # [K]
_GAS_CONSTANT = 8.314510  # [J/(mol K)], as in the paper; it cancels except for the water vapour
# Refractivity of standard air (15 degC, 101325 Pa, 450 ppm) and of water vapour (20 degC, 1333 Pa) [um^-2, um^2 ...].
_K0, _K1, _K2, _K3 = 238.0185, 5792105.0, 57.362, 167917.0
_VAPOUR, _VAPOUR_CORRECTION = (295.235, 2.6422, -0.032380, 0.004028), 1.022
# Compressibility (Davis 1992) in K, Pa and degC.
_A = (1.58123e-6, -2.9331e-8, 1.1043e-10)
_B, _C, _D, _E = (5.707e-6, -2.051e-8), (1.9898e-4, -2.376e-6), 1.83e-11, -0.765e-8
# Saturation vapour pressure over water, exp(A T^2 + B T + C + D/T), and its enhancement in air.
_SATURATION = (1.2378847e-5, -1.9121316e-2, 33.93711047, -6.3431645e3)
_ENHANCEMENT = (1.00062, 3.14e-8, 5.6e-7)
# Range of validity of the equation: unit, lowest and highest value of each input.
_RANGES = {
    "wavelength": ("m", 300e-9, 1700e-9),
    "temperature": ("degC", -40.0, 100.0),
    "pressure": ("Pa", 10e3, 140e3),
    "humidity": ("", 0.0, 1.0),
    "co2": ("", 0.0, 2000e-6),
}


def refractive_index(
    wavelength: float = 632.9908e-9,
    *,
    temperature: float = 20.0,
    pressure: float = 101325.0,
    humidity: float = 0.5,
    co2: float = 450e-6,
) -> float:
    """Compute the phase refractive index of air with Ciddor's equation (1996).

    Args:
        wavelength: vacuum wavelength of the light [m], 300 nm to 1700 nm; default: a helium-neon laser.
        temperature: temperature of the air [degC], -40 to 100.
        pressure: pressure of the air [Pa], 10 kPa to 140 kPa.
        humidity: relative humidity over water [1], 0 to 1.
        co2: mole fraction of carbon dioxide [1], 0 to 2000 ppm.

    Returns:
        The index [1]. With exact inputs its standard uncertainty is `EQUATION_STD`. At 20 degC it changes by 1e-7 for
        0.1 degC, by 3e-7 for 100 Pa, and by 1e-7 for 0.1 of relative humidity.

    Raises:
        UsageError: a value is outside the range of validity of the equation.

    Examples:
        >>> from fricjax.instrument import refractive_index
        >>> print(f"{refractive_index(633e-9, temperature=20.0, pressure=101325.0, humidity=0.5):.9f}")
        1.000271373
    """
    inputs = {
        "wavelength": wavelength,
        "temperature": temperature,
        "pressure": pressure,
        "humidity": humidity,
        "co2": co2,
    }
    light, celsius, p, h, carbon = (_checked(name, value) for name, value in inputs.items())
    wave_number = (1e-6 / light) ** 2  # squared [um^-2]
    kelvin = celsius + _ZERO_CELSIUS
    water = _enhanced(celsius, p) * h * _saturated(kelvin) / p
    dry_mole = 1e-3 * (28.9635 + 12.011e-6 * (1e6 * carbon - 400))
    dry_standard = 1e-8 * (_K1 / (_K0 - wave_number) + _K3 / (_K2 - wave_number))
    dry_standard *= 1 + 0.534e-6 * (1e6 * carbon - 450)
    vapour_standard = 1e-8 * _VAPOUR_CORRECTION * sum(w * wave_number**i for i, w in enumerate(_VAPOUR))
    # Densities relative to those of the reference refractivities.
    dry = _moles(kelvin, p, water) * (1 - water) * dry_mole / (_moles(288.15, 101325.0, 0.0) * dry_mole)
    vapour = _moles(kelvin, p, water) * water / _moles(293.15, 1333.0, 1.0)
    return 1.0 + dry * dry_standard + vapour * vapour_standard


def _checked(name: str, value: float) -> float:
    unit, low, high = _RANGES[name]
    checked = number(name, value, unit)
    if not low <= checked <= high:
        range_ = f"{low:g} and {high:g} {unit}".strip()
        raise UsageError(f"{name} must lie between {range_} for Ciddor's equation, got {checked:g}.")
    return checked


def _saturated(kelvin: float) -> float:
    """Saturation vapour pressure over water [Pa]."""
    a, b, c, d = _SATURATION
    return math.exp(a * kelvin**2 + b * kelvin + c + d / kelvin)


def _enhanced(celsius: float, p: float) -> float:
    alpha, beta, gamma = _ENHANCEMENT
    return alpha + beta * p + gamma * celsius**2


def _moles(kelvin: float, p: float, water: float) -> float:
    """Molar density of moist air [mol/m^3] with vapour fraction `water`."""
    t = kelvin - _ZERO_CELSIUS
    first = _A[0] + _A[1] * t + _A[2] * t**2 + (_B[0] + _B[1] * t) * water + (_C[0] + _C[1] * t) * water**2
    compressibility = 1 - p / kelvin * first + (p / kelvin) ** 2 * (_D + _E * water**2)
    return p / (compressibility * _GAS_CONSTANT * kelvin)
