"""Fit a run on a moving floor with recorded acceleration.

The floor drives the mass like a force ``-m a_floor``. Its effect persists in all later samples, so it is no noise that
a fit could average out. But it is known: the fitted machine is simulated with and without the floor motion, and the
difference is subtracted from the record. The rest is fitted as for a floor at rest. The difference hardly depends on
the coefficients, so two or three iterations suffice.
"""

from collections.abc import Sequence
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..data import Record, Trace
from ..data.gather import record_of
from ..data.record import check_displacement
from ..errors import DataError, UsageError
from ..oscillator import Oscillator, simulate
from .fit import fit
from .parameters import Settings
from .result import Fit

_ROUNDS = 6
_SETTLED = 1e-2


def fit_on_moving_floor(
    data: object,
    base_acceleration: ArrayLike,
    oscillator: Oscillator,
    free: Sequence[str],
    **settings: Unpack[Settings],
) -> Fit:
    """Fit one run with a recorded acceleration of the floor.

    Args:
        data: the run, relative to the floor, as an interferometer on that floor reads it; any input of `fricjax.read`.
        base_acceleration: acceleration of the floor at the samples of the record [m/s^2], shape (samples,).
        oscillator: the machine.
        free: names of the coefficients to fit.
        **settings: settings of :func:`fricjax.fit`.

    Returns:
        The fit of the run after subtraction of the floor's effect; its residuals are those of that run.

    Raises:
        UsageError: an acceleration of another shape; as in :func:`fricjax.fit`.
        DataError: an acceleration that is not finite; as in :func:`fricjax.fit`.
        FitError: a fit that is not valid.

    ```python
    fricjax.fit_on_moving_floor("run.csv", floor_acceleration, oscillator, ["mu", "damping", "stiffness"])
    ```

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> t = np.arange(1200) / 2e3
        >>> floor = 1e-3 * np.sin(100 * t)  # m/s^2
        >>> x = np.asarray(fj.simulate(machine, 2e-3, t, base_acceleration=floor).x)
        >>> run = fj.Trace(t, x + 1e-9 * np.random.default_rng(0).standard_normal(t.size))
        >>> round(fj.fit_on_moving_floor(run, floor, machine, ["mu", "damping", "stiffness"]).values["mu"], 5)
        0.05
    """
    record = record_of(data)
    check_displacement(record, "a fit on a moving floor")
    floor = _checked(base_acceleration, record.trace)
    result = fit(record, oscillator, free, **settings)
    for _ in range(_ROUNDS):
        before, response = result, _response(result, record.t, floor)
        trace = Trace(record.t, record.x - response, sigma=record.sigma, mask=record.mask)
        result = fit(Record(trace, record.meta, record.log), oscillator, free, **settings)
        changes = [abs(result.values[name] - before.values[name]) / result.std_errors[name] for name in result.names]
        if max(changes) < _SETTLED:
            break
    return result


def _checked(base_acceleration: ArrayLike, trace: Trace) -> np.ndarray:
    floor = np.asarray(base_acceleration, float)
    if floor.shape != trace.t.shape:
        raise UsageError(
            f"base_acceleration needs one number per sample, {trace.n} of them, got an array of shape {floor.shape}."
        )
    lost = np.flatnonzero(~np.isfinite(floor))
    if lost.size:
        raise DataError(f"base_acceleration[{lost[0]}] is {floor[lost[0]]}. Fill its gaps before the fit.")
    return floor


def _response(result: Fit, t: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """Return the displacement caused by the floor after the start [m]."""
    start = result.run_parameter("t_release")
    later = t > start
    ts, x0, v0 = t[later] - start, result.run_parameter("x0"), result.run_parameter("v0")
    response = np.zeros(t.shape)
    on_floor = lambda a: np.asarray(simulate(result.oscillator, x0, ts, v0=v0, base_acceleration=a).x)
    response[later] = on_floor(floor[later]) - on_floor(0 * ts)
    return response
