"""Errors of `fit`, tested by their message."""

import subprocess
import sys

import numpy as np
import pytest

from fricjax import Oscillator, Record, Trace, fit
from fricjax.errors import DataError, UsageError
from fricjax.friction import Coulomb, LuGre, QuadraticDrag, Stribeck, Tanh
from tests.helpers import PROTOTYPE_MASS
from tests.machines import MACHINE, coulomb_run

RUN = coulomb_run()


def machine(friction=None):
    return Oscillator(PROTOTYPE_MASS, 2574.0, 0.2, 9.66, friction or Coulomb(0.05))


USAGE = {
    "mu and load": (
        {"free": ["mu", "normal_force"]},
        r"mu and normal_force cannot both be free, for they are not identifiable: "
        r"the motion depends only on their product",
    ),
    "mass and stiffness": (
        {"free": ["mass", "stiffness", "mu"]},
        r"mass and stiffness cannot both be free, for they are not identifiable: "
        r"the motion depends only on their ratio",
    ),
    "quadratic drag and drag": (
        {"oscillator": machine(Coulomb(0.05) + QuadraticDrag(0.1)), "free": ["mu", "drag"]},
        r"drag cannot be free together with a quadratic-drag law: both are the same force\. Leave one of them out\.",
    ),
    "a reference": (
        {"oscillator": machine(Tanh(0.05, 1e-4)), "engine": "diffrax"},
        r"The diffrax engine is a reference for simulations\. Fit with another one, such as auto\.",
    ),
    "viscous twice": (
        {"oscillator": machine(LuGre(0.05)), "free": ["mu", "damping", "sigma2"]},
        r"damping and sigma2 cannot both be free, for they are not identifiable: both are the same force",
    ),
    "quadratic drag twice": (
        {
            "oscillator": machine(QuadraticDrag(0.1) + QuadraticDrag(0.2)),
            "free": [f"friction.{i}.quadratic_drag" for i in (0, 1)],
        },
        r"quadratic_drag is free twice, for the same force\. Free it once\.",
    ),
    "unknown name": (
        {"free": ["mu", "dampign"]},
        r"This oscillator has no coefficient 'dampign'\. Did you mean 'damping'\? It has mass, stiffness, damping, ",
    ),
    "ambiguous name": (
        {"oscillator": machine(Coulomb(0.02) + Coulomb(0.03)), "free": ["mu"]},
        r"'mu' is ambiguous here: say which one, friction\.0\.mu or friction\.1\.mu\.",
    ),
    "named twice": ({"free": ["mu", "friction.mu"]}, r"A parameter is named twice in free=\['mu', 'friction.mu'\]\."),
    "nothing free": (
        {"free": []},
        r"Nothing is free\. Name at least one of mass, stiffness, damping, normal_force, mu, ",
    ),
    "mu_s of a tied law": (
        {"free": ["mu", "mu_s"]},
        r"This law has no separate mu_s: it is tied to mu\. Set one, such as mu_s=0\.1\.",
    ),
    "only mu_s": (
        {"oscillator": machine(Coulomb(0.05, 0.06)), "free": ["mu_s"]},
        r"mu_s of a Coulomb law is bracketed from stops, not fitted\. Free mu as well\.",
    ),
    "bounds of a fixed parameter": (
        {"bounds": {"damping ": (0, None), "mass": (0, 1)}},
        r"Bounds are given for 'damping ', which is not a free parameter\. Did you mean 'damping'\? Free are mu, ",
    ),
    "bounds the wrong way round": (
        {"bounds": {"damping": (1, 0)}},
        r"The bounds of damping must be a lower and a larger upper value, got 1 and 0\.",
    ),
    "bounds that are no pair": (
        {"bounds": {"damping": 0}},
        r"The bounds of damping must be a lower and an upper value or None, got 0\.",
    ),
    "prior of a fixed parameter": (
        {"priors": {"mass": (1, 1)}},
        r"Priors are given for 'mass', which is not a free parameter\.",
    ),
    "prior without width": (
        {"priors": {"mu": (0.1, 0.0)}},
        r"The prior of mu needs a positive standard deviation, got 0\.0\.",
    ),
    "prior that is no pair": (
        {"priors": {"mu": 0.1}},
        r"The prior of mu must be a mean and a standard deviation, got 0\.1\.",
    ),
    "tie to a fixed parameter": (
        {"tie": {"drag": "stifness"}},
        r"Ties are given for 'stifness', which is not a free parameter\. Did you mean 'stiffness'\?",
    ),
    "tie of a free parameter": (
        {"tie": {"damping": "mu"}},
        r"damping is tied to mu and cannot be free as well\. Take it out of free=\.",
    ),
    "sigma mode": (
        {"sigma_mode": "absolut"},
        r"There is no sigma_mode 'absolut'\. Did you mean 'absolute'\? Choose ",
    ),
    "start": (
        {"start": "first_reversl"},
        r"There is no start 'first_reversl'\. Did you mean 'first_reversal'\? Choose first_reversal, release or ",
    ),
    "start outside": ({"start": 3.0}, r"start=3\.0 s lies outside the record, which lasts 0\.3998 s\."),
    "nuisance": (
        {"nuisance": ["x0", "ofset"]},
        r"There is no nuisance parameter 'ofset'\. Did you mean 'offset'\? Known are x0, v0, offset, drift, ",
    ),
    "two shifts in time": (
        {"nuisance": ["v0", "t_release"]},
        r"v0 and t_release cannot both be free: each shifts the motion in time\.",
    ),
    "engine": (
        {"engine": "exat"},
        r"There is no engine 'exat'\. Did you mean 'exact'\? Choose one of auto",
    ),
    "engine for another law": (
        {"engine": "smooth"},
        r"The smooth engine cannot integrate the jump of Coulomb\. Use the exact or the hybrid engine",
    ),
    "drag in the exact engine": (
        {"engine": "exact", "free": ["mu", "drag"]},
        r"The exact engine has no quadratic drag, but drag is free\. Use the hybrid engine\.",
    ),
    "no record": ({"data": []}, r"There is no run: the list is empty\."),
    "no run": ({"data": 3.0}, r"A record cannot be made of float\. Give a path, a record, a pandas table or series,"),
    "an array without times": (
        {"data": RUN.x},
        r"needs either their rate or their times: a tuple \(t, x\), fricjax\.read\(x, rate=5000\.0\) or "
        r"fricjax\.fit\(x, \.\.\., rate=5000\.0\)\.$",
    ),
    "no oscillator": (
        {"oscillator": Coulomb(0.1)},
        r"fit needs an Oscillator, got Coulomb\. Build one, or take rig\.oscillator\(friction\)\.",
    ),
}


@pytest.mark.parametrize("name", USAGE)
def test_wrong_usage(name):
    changed, sentence = USAGE[name]
    arguments = {"data": RUN, "oscillator": machine(), "free": MACHINE, **changed}
    with pytest.raises(UsageError, match=sentence) as caught:
        fit(arguments.pop("data"), arguments.pop("oscillator"), arguments.pop("free"), **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_parameter_without_effect_is_refused():
    """Free v_stribeck while the static coefficient equals the dynamic one."""
    stribeck = machine(Stribeck(0.05, v_stribeck=5e-3))
    with pytest.raises(UsageError, match=r"v_stribeck cannot be fitted: the fitted motion does not depend on it\."):
        fit(RUN, stribeck, ["v_stribeck"], nuisance=["x0"])


def test_friction_without_a_load_is_refused():
    unloaded = Oscillator(PROTOTYPE_MASS, 2574.0, 0.18, 0.0, Coulomb(0.05))
    with pytest.raises(
        UsageError, match=r"under a normal force of zero\. Take it out of free=, or give the normal force"
    ):
        fit(RUN, unloaded, MACHINE)


def test_fewer_than_two_half_cycles_do_not_determine_friction_beside_an_offset():
    short = coulomb_run(0.5e-3)  # one half-cycle: the first reversal is the stop
    with pytest.raises(DataError, match=r"with the offset free friction is undetermined from fewer than two"):
        fit(short, machine(), ["mu"], start="release")
    with pytest.raises(DataError, match=r"holds 1 complete half-cycle"):
        fit(coulomb_run(0.7e-3), machine(), ["mu"])
    with pytest.raises(DataError, match=r"The fitted window of run 1 holds 1 complete"):
        fit([RUN, coulomb_run(0.7e-3)], machine(), ["mu"])


@pytest.mark.slow
def test_one_half_cycle_is_enough_where_the_offset_is_known():
    found = fit(coulomb_run(0.5e-3), machine(), ["mu"], start="release", nuisance=["x0"])
    assert abs(found.values["mu"] - 0.05) < 1e-4  # the damping held fixed is 14 % too large


def test_a_record_without_a_reversal():
    t = np.arange(500) / 5e3
    overdamped = 1e-3 * np.exp(-20 * t)
    with pytest.raises(DataError, match=r"no reversal to start from\. Fit from the release: start='release'\."):
        fit(Trace(t, overdamped + 1e-9 * np.random.default_rng(0).standard_normal(500), sigma=1e-9), machine(), ["mu"])


def test_a_window_of_a_few_samples():
    with pytest.raises(DataError, match=r"The fitted window holds only [0-7] samples\. Widen it\."):
        fit(RUN, machine(), MACHINE, start=float(RUN.duration) - 4 / 5e3)


def test_a_constant_trace():
    with pytest.raises(DataError, match=r"x is constant"):
        fit(Trace(RUN.t, np.full(RUN.n, 1e-3)), machine(), MACHINE)


def test_a_release_logged_outside_of_the_record():
    with pytest.raises(DataError, match=r"The logged release at 7 s lies behind the record, which ends at 0\.3998 s\."):
        fit(Record(RUN, {"release_time": 7.0}), machine(), MACHINE, start="release")


def test_errors_come_before_any_compilation():
    """Refuse a wrong name, also with a regularised law."""
    with pytest.raises(UsageError, match="no coefficient 'sigma0'"):
        fit(RUN, machine(Tanh(0.05, 1e-4)), ["mu", "sigma0"])


def test_single_precision_is_refused_with_the_remedy():
    script = (
        "import numpy as np, fricjax as fj\n"
        "t = np.linspace(0, 1, 100)\n"
        "fj.fit(fj.Trace(t, np.cos(20 * t)), fj.Oscillator(1, 400, 0, 1, fj.friction.Coulomb(0.1)), ['mu'])\n"
    )
    environment = {"JAX_ENABLE_X64": "0", "PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
    assert done.returncode == 1
    assert "RuntimeError: fricjax computes in double precision, and JAX is set to single." in done.stderr
    assert 'jax.config.update("jax_enable_x64", True)' in done.stderr


OSCILLATOR = Oscillator(0.4, 2500.0, 0.2, 10.0, Coulomb(0.05))
T = np.arange(99.0)


@pytest.mark.parametrize("free", [None, 3, OSCILLATOR])
def test_names_that_are_none(free):
    with pytest.raises(UsageError, match=r"free= takes the names of the parameters to fit, such as \['mu', 'dam"):
        fit((T, np.cos(T)), OSCILLATOR, free)


def test_a_list_of_times_and_displacements_is_no_run():
    with pytest.raises(UsageError, match=r"A list is several runs.* Write a tuple \(t, x\)"):
        fit([T, np.cos(T)], OSCILLATOR, ["mu"])
