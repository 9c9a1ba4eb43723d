"""`fricjax compare`: its table and JSON, and options for each law."""

import json

import numpy as np
import pytest

from fricjax.cli.options import Bench
from fricjax.data.read import example_paths
from fricjax.errors import UsageError
from fricjax.machine.choose import contenders
from tests.tables import check_rows

RUN, RIG = example_paths()


def test_the_law_of_the_example_run(fricjax, tmp_path):
    picture = tmp_path / "laws.png"
    called = fricjax(
        "compare", RUN, "--rig", RIG, "--friction", "coulomb", "--no-held-out", "--json", "--plot", picture
    )
    assert (called.code, called.err) == (0, "")
    report = json.loads(called.out)
    assert (report["best"], report["calibrated"], report["files"]) == ("coulomb", True, {"picture": str(picture)})
    assert report["rows"][0]["free"] == ["mu", "damping", "stiffness"]
    assert report["rows"][0]["tests"]["failed"] == []
    assert picture.stat().st_size > 10_000
    plain = fricjax("compare", RUN, "--friction", "coulomb", "--no-held-out", "--quiet")
    assert plain.code == 0
    assert "Reduced chi^2" in plain.out and "natural frequency" in plain.out and " mu " not in plain.out


def test_values_go_to_the_laws_that_have_them():
    bench = Bench(rig=RIG, fix=["sigma1=250", "damping=0.2"])
    laws = ["coulomb", "stribeck", "dahl", "lugre"]
    choices = contenders(bench, laws, ["sigma0=2e5", "v_stribeck=0.004"])
    assert [choice.free for choice in choices] == [
        ("mu", "stiffness"),
        ("mu", "mu_s", "v_stribeck", "stiffness"),
        ("mu", "sigma0", "stiffness"),
        ("mu", "sigma0", "stiffness"),
    ]
    _, stribeck, dahl, lugre = (choice.oscillator.friction for choice in choices)
    assert float(stribeck.v_stribeck) == 0.004  # type: ignore[attr-defined]
    assert float(dahl.sigma0) == float(lugre.sigma0) == 2e5  # type: ignore[attr-defined]
    assert float(lugre.sigma1) == 250  # type: ignore[attr-defined]
    assert all(np.isclose(choice.oscillator.damping, 0.2) for choice in choices)


def test_without_a_stiffness_the_mass_is_known():
    (choice,) = contenders(Bench(stiffness="2574", normal_force="9.66"), ["coulomb"])
    assert choice.free == ("mu", "damping", "mass")


REFUSED = [
    (["mu=0.1"], ["mu=0.2"], ["coulomb"], "mu is fixed and has a start value"),
    (["sigma7=1"], None, ["coulomb"], "no coefficient 'sigma7'"),
    (None, None, ["coulomb", "ratestate"], "RateState friction needs a"),
    (None, None, ["coulomb", "strybeck"], "no friction law 'strybeck'. Did you mean 'stribeck'?"),
]
CODES = [
    (("--friction", "coulomb", "--criterion", "aic"), 2),
    (("--friction", "nothing"), 2),
    (("--friction", "coulomb", "--plot", "laws.txt"), 2),
    (("--friction", "coulomb", "--crop", "0:0.001"), 4),
]


def test_options_that_do_not_fit():
    def check(fix, guess, laws, words):
        with pytest.raises(UsageError, match=words):
            contenders(Bench(rig=RIG, fix=fix), laws, guess)

    check_rows(check, REFUSED)


def test_exit_codes(fricjax):
    def check(words, code):
        called = fricjax("compare", RUN, "--rig", RIG, "--json", *words)
        assert called.code == code
        assert json.loads(called.out)["exit_code"] == code

    check_rows(check, CODES)
