"""Sliders in a notebook, which show how each coefficient changes the motion."""

from typing import Any

import jax
import numpy as np

from ..errors import needed
from ..oscillator import Oscillator, simulate
from ..oscillator.oscillator import leaves_of
from ..show import engineering
from ..show.thumbnail import Curve, curves_svg
from .names import of_run

# Samples that are drawn, and computed again at each move of a slider in about 1 ms.
_SAMPLES = 800
# Largest ratio between the value of a slider and the fitted one.
_REACH = 3.0
# Steps of a slider from end to end.
_STEPS = 600


class Sliders:
    """Sliders for the free coefficients and the initial displacement.

    The model is drawn over the record. `Fit.interactive` creates them; a notebook displays them.

    Attributes:
        sliders: ipywidgets sliders, by name of the parameter.
        guess: values of the sliders by name, to pass as `guess` to a fit.
        model: reading computed with these values at the times `t` [s]; NaN before the motion starts.

    Raises:
        UsageError: ipywidgets is not installed.
    """

    def __init__(self, fit: Any, run: int = 0) -> None:
        widgets = needed("A panel of sliders", "ipywidgets", "notebooks")
        self._fit, self._run = fit, run
        every = max(1, fit.times[run].size // _SAMPLES)
        self.t, self._x = fit.times[run][::every], np.asarray(fit.runs[run].x)[::every]
        end = "" if len(fit.runs) == 1 else f"[{run}]"
        moved = [name for name in fit.names if not of_run(name) or name == f"x0{end}"]
        self.sliders = {name: _slider(widgets, name, fit.values[name], fit.units[name]) for name in moved}
        self._picture = widgets.HTML()
        for slider in self.sliders.values():
            slider.observe(self._draw, names="value")
        self.box = widgets.VBox([*self.sliders.values(), self._picture])
        self._draw()

    @property
    def guess(self) -> dict[str, float]:
        return {name: float(slider.value) for name, slider in self.sliders.items()}

    @property
    def oscillator(self) -> Oscillator:
        """The oscillator with the values of the sliders."""
        flat, structure = jax.tree.flatten(self._fit.oscillator)
        for leaf in leaves_of(self._fit.oscillator):
            flat[leaf.index] = self.guess.get(leaf.name, flat[leaf.index])
        return jax.tree.unflatten(structure, flat)

    @property
    def model(self) -> np.ndarray:
        at = {name: self._fit.run_parameter(name, self._run) for name in self._fit.runs[self._run].fixed}
        at |= {name.split("[")[0]: value for name, value in self.guess.items() if of_run(name)}
        begin = at["t_release"] if at.get("t_release") is not None else self._fit.origins[self._run]
        before = int(np.sum(self.t < begin))
        # Pad the times behind the record by those before the motion, so that all calls share one compilation.
        step = self.t[-1] - self.t[-2]
        times = np.append(self.t[before:], self.t[-1] + step * np.arange(1, before + 1)) - begin
        x = np.asarray(simulate(self.oscillator, at["x0"], times, v0=at["v0"]).x)[: self.t.size - before]
        read = x + at["offset"] + at["drift"] * (self.t[before:] - self._fit.origins[self._run])
        return np.append(np.full(before, np.nan), read)

    def _draw(self, *_: Any) -> None:
        model, fit = self.model, self._fit
        rms = float(np.sqrt(np.nanmean((self._x - model) ** 2)))
        curves = [Curve(self.t, self._x, broad=True), Curve(self.t, model)]
        picture = curves_svg(curves, ("Time", "s"), (fit.observation.name, fit.quantity))
        self._picture.value = f"{picture}<div>measured minus model: {engineering(rms, fit.quantity)} rms</div>"

    def _repr_mimebundle_(self, **how: Any) -> Any:
        return self.box._repr_mimebundle_(**how)

    def __repr__(self) -> str:
        return f"Sliders({', '.join(f'{name}={value:.6g}' for name, value in self.guess.items())})"


def _slider(widgets: Any, name: str, value: float, unit: str) -> Any:
    """Return a slider about a value, logarithmic for positive values."""
    settings = {
        "description": f"{name} [{unit}]" if unit else name,
        "readout_format": ".5g",
        "style": {"description_width": "12em"},
        "layout": {"width": "34em"},
    }
    if value > 0:
        ends = np.log10([value / _REACH, value * _REACH])
        return widgets.FloatLogSlider(value, min=ends[0], max=ends[1], step=(ends[1] - ends[0]) / _STEPS, **settings)
    reach = _REACH * abs(value) or 1.0
    return widgets.FloatSlider(value, min=-reach, max=reach, step=2 * reach / _STEPS, **settings)
