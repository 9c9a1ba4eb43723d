"""Rough decays of records, from their turning points.

None of the numbers below decides about a result: a start that is too rough only makes the proof fail.
"""

import numpy as np

from .decay import NEVER, FreeDecay

# Means of blocks of samples show the turning points as well as all samples.
_BLOCKS = 1024
# Least number of turning points, and change beyond a turning point as a part of the range.
_FEWEST, _BEYOND = 3, 0.05
# Largest deviation of a half-cycle from the mean, as a part of it.
_UNEVEN = 0.12
_LONGEST = 2000


def rough_decays(x: np.ndarray, dt: float) -> tuple[np.ndarray, FreeDecay]:
    """Return runs that look like a decay, and their rough coefficients.

    Args:
        x: readings at equal intervals [m], shape (runs, samples).
        dt: the interval [s].

    Returns:
        Indices of the runs, and their decays.

    Examples:
        >>> import numpy as np
        >>> t = np.arange(1000) / 1000
        >>> runs, decays = rough_decays(np.stack([np.exp(-t) * np.cos(20 * t), t]), 1e-3)
        >>> runs, round(float(decays.omega[0]))
        (array([0]), 20)
    """
    size = max(1, x.shape[1] // _BLOCKS)
    blocks = x.shape[1] // size
    means = x[:, : blocks * size].reshape(len(x), blocks, size).mean(axis=2)
    rough = [_rough_decay(mean, size * dt, x.shape[1] * dt) for mean in means]
    runs = np.array([run for run, decay in enumerate(rough) if decay is not None], dtype=int)
    columns = zip(*(decay for decay in rough if decay is not None), strict=True)
    return runs, FreeDecay._make(map(np.array, columns) if runs.size else np.zeros((7, 0)))


def _rough_decay(x: np.ndarray, dt: float, duration: float) -> tuple[float, ...] | None:
    """Return the rough coefficients of one run."""
    half = x.size // 2
    places = 2 * np.array(_turning_points(x[: 2 * half : 2].tolist(), _BEYOND * float(np.ptp(x))), dtype=int)
    places = places[places < x.size - 3]
    places = places[0 if _approached(x, places) else 1 :]
    if places.size < _FEWEST:
        return None
    # A parabola through the points about each turning point.
    width = int(np.clip((places[-1] - places[0]) / (places.size - 1) / 6, 1, 8))
    near = np.arange(-width, width + 1)
    values = x[np.clip(places[:, None] + near, 0, x.size - 1)]
    curved = near**2 - np.mean(near**2)
    bend, slope = values @ curved / (curved @ curved), values @ near / (near @ near)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.clip(-slope / (2 * bend), -width, width)
        point = values.mean(axis=1) - bend * np.mean(near**2) - slope**2 / (4 * bend)
    t = (places + shift + 0.5) * dt
    lasts = np.diff(t)
    order = np.arange(t.size) - (t.size - 1) / 2
    period = float(order @ t / (order @ order))
    if not np.max(np.abs(lasts - period)) < _UNEVEN * period:
        return None
    offset = float(np.median(point[:-2] + 2 * point[1:-1] + point[2:]) / 4)
    swing = np.abs(point - offset)
    # The next deflection is rho a - (1 + rho) d.
    centred = swing[:-1] - swing[:-1].mean()
    rho = float(np.clip(centred @ swing[1:] / (centred @ centred), 0.3, 1.0))
    band = float(np.mean(rho * swing[:-1] - swing[1:]) / (1 + rho))
    band = band if band > 0 else 1e-6 * float(swing[0])
    z = -np.log(rho) / period
    stop = _stop(float(swing[0]), rho, band)
    stop = NEVER if t[0] + stop * period > duration - 8 * dt else stop
    start = float(np.sign(point[0] - offset) * swing[0])
    return float(t[0]) - dt / 2, start, offset, (np.pi / period) ** 2 + z**2, z, band, stop


def _approached(x: np.ndarray, places: np.ndarray) -> bool:
    """Return True if the mass swings to the first turning point.

    A quarter of a half-cycle before it, the deflection is then 71 % of the largest, and 100 % if the mass is held.
    """
    if places.size < 2:
        return False
    before = round((places[-1] - places[0]) / (places.size - 1) / 4)
    middle = (x[places[0]] + x[places[1]]) / 2
    return bool(places[0] >= before and abs(x[places[0] - before] - middle) < 0.85 * abs(x[places[0]] - middle))


def _stop(swing: float, rho: float, band: float) -> int:
    """Return the number of half-cycles until the spring cannot move the mass."""
    count = 0
    while swing > band and count < _LONGEST:
        swing, count = rho * swing - (1 + rho) * band, count + 1
    return count if count < _LONGEST else NEVER


def _turning_points(values: list[float], beyond: float) -> list[int]:
    """Return the indices of turning points that the motion leaves by `beyond`."""
    places, direction = [], 0
    high = low = values[0]
    high_at = low_at = 0
    for i, value in enumerate(values):
        if direction >= 0 and value > high:
            high, high_at = value, i
        if direction <= 0 and value < low:
            low, low_at = value, i
        if direction >= 0 and high - value > beyond:
            places.append(high_at)
            direction, low, low_at = -1, value, i
        elif direction <= 0 and value - low > beyond:
            places.append(low_at)
            direction, high, high_at = 1, value, i
    return places
