"""`fricjax check`: parameters that a planned run determines, and exit codes."""

import json

import pytest

from fricjax.data.read import example_paths
from tests.tables import check_rows

RIG = ("--rig", example_paths()[1], "--normal-force", "9.66")


def test_a_run_that_determines_its_parameters(fricjax, tmp_path):
    words = (*RIG, "--fix", "mu=0.02", "--free", "mu,damping,stiffness", "--x0", "1mm", "--noise", "1nm")
    called = fricjax("check", *words, "--json", "--plot", tmp_path / "check.png")
    assert (called.code, called.err) == (0, "")
    report = json.loads(called.out)
    assert report["n_half_cycles"] == 6 and report["rate"] == pytest.approx(10e3) and report["undetermined"] == []
    # With the frequency, the damping, x0 and the offset free the bound lies between 8e-8 and 3.3e-7 of mu.
    assert 8e-8 < report["std_errors"]["mu"] / 0.02 < 3.3e-7
    assert (tmp_path / "check.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_run_that_leaves_parameters_undetermined(fricjax):
    words = ("--free", "mu=0.02,mu_s=0.03,normal_force", "--x0", "1e-3", "--rate", "5k", "--duration", "0.3")
    called = fricjax("check", *RIG, *words, "--quiet")
    assert called.code == 3
    assert "!! mu and normal_force only as a product. Fix one of them." in called.out
    assert "!! mu_s acts through the number of half-cycles alone" in called.out


REFUSED = [
    (("--x0", "1mm"), "Coulomb friction needs mu: give it with --fix mu=..."),
    (("--x0", "1mm", "--fix", "mu=0.02", "--free", "muu"), "no coefficient 'muu'"),
    (("--x0", "1mm", "--fix", "mu=0.02", "--rate", "often"), "--rate must be a number, got 'often'"),
    (("--x0", "1mm", "--fix", "mu=0.02", "--free", "mu=0.03"), "--fix gives mu twice"),
]


def test_wrong_options_are_refused(fricjax):
    def check(words, message):
        called = fricjax("check", *RIG, *words)
        assert called.code == 2
        assert message in called.err

    check_rows(check, REFUSED)
