"""``fricjax check``: what a planned run will tell, and the code that it ends with."""

import json

import pytest

from fricjax.data.read import example_paths

RIG = ("--rig", example_paths()[1], "--normal-force", "9.66")


def test_a_run_that_tells_what_is_asked(fricjax, tmp_path):
    words = (*RIG, "--fix", "mu=0.02", "--free", "mu,damping,stiffness", "--x0", "1mm", "--noise", "1nm")
    called = fricjax("check", *words, "--json", "--plot", tmp_path / "check.png")
    assert (called.code, called.err) == (0, "")
    told = json.loads(called.out)
    assert told["n_half_cycles"] == 6 and told["rate"] == pytest.approx(10e3) and told["undetermined"] == []
    # With the frequency, the damping, x0 and the offset free the bound lies between 8e-8 and 3.3e-7 of mu.
    assert 8e-8 < told["std_errors"]["mu"] / 0.02 < 3.3e-7
    assert (tmp_path / "check.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_that_does_not(fricjax):
    words = ("--free", "mu=0.02,mu_s=0.03,normal_force", "--x0", "1e-3", "--rate", "5k", "--duration", "0.3")
    called = fricjax("check", *RIG, *words, "--quiet")
    assert called.code == 3
    assert "!! mu and normal_force only as a product. Fix one of them." in called.out
    assert "!! mu_s acts through the number of half-cycles alone" in called.out


@pytest.mark.parametrize(
    "words, message",
    [
        (("--x0", "1mm"), "Coulomb friction needs mu: give it with --fix mu=..."),
        (("--x0", "1mm", "--fix", "mu=0.02", "--free", "muu"), "no coefficient 'muu'"),
        (("--x0", "1mm", "--fix", "mu=0.02", "--rate", "often"), "--rate must be a number, got 'often'"),
        (("--x0", "1mm", "--fix", "mu=0.02", "--free", "mu=0.03"), "--fix gives mu twice"),
    ],
)
def test_what_is_refused(fricjax, words, message):
    called = fricjax("check", *RIG, *words)
    assert called.code == 2
    assert message in called.err
