"""Sliders without a browser: picture and model follow their values."""

import sys

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]


@pytest.fixture(scope="module")
def fit():
    run = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
    return fj.fit(run, MACHINE, FREE)


def test_a_moved_slider_moves_the_model(fit):
    panel = fit.interactive()
    assert set(panel.sliders) == {"mu", "damping", "stiffness", "x0"}
    begun = np.isfinite(panel.model)
    # At the fitted values the model is that of the fit.
    np.testing.assert_allclose(panel.model[begun], fit.predict(panel.t[begun]), atol=1e-11)
    before = panel._picture.value
    panel.sliders["mu"].value = 0.08
    assert panel.guess["mu"] == pytest.approx(0.08) and panel._picture.value != before
    assert "rms" in panel._picture.value and "<svg" in panel._picture.value
    # With mu = 0.08 the mass stops within the dead band of 0.32 mm about the offset.
    assert float(panel.oscillator.dead_band) == pytest.approx(0.08 * 10 / fit.values["stiffness"])
    rest = panel.model[-1] - fit.values["offset"]
    assert abs(rest) <= float(panel.oscillator.dead_band) and rest != pytest.approx(fit.predict([0.6])[0])
    again = fj.fit(fit.problem.windows[0].trace, MACHINE, FREE, guess=panel.guess)
    assert again.values["mu"] == pytest.approx(fit.values["mu"], abs=1e-2 * fit.std_errors["mu"])


def test_a_notebook_is_given_the_widget(fit):
    assert "application/vnd.jupyter.widget-view+json" in fit.interactive()._repr_mimebundle_()


def test_without_ipywidgets_one_sentence_says_what_to_install(fit, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(UsageError, match=r"needs the package ipywidgets: pip install 'fricjax\[notebooks\]'\."):
        fit.interactive()
    with pytest.raises(UsageError, match="There is no run 1"):
        fit.interactive(run=1)
