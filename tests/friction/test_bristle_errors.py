"""Error messages for impossible coefficients of bristle laws."""

import pytest

from fricjax.friction import BlimanSorine, BoucWen, Dahl, ElastoPlastic, LuGre, RateState, RateStateSlip, Rolling

REFUSED = [
    (lambda: Dahl(0.0, 1e5), "mu of Dahl must be a positive number, got 0.0."),
    (lambda: Dahl(0.1, -1.0), "sigma0 of Dahl must be a positive number of N/m, got -1.0."),
    (lambda: Dahl(0.1, 1e5, 0.5), "exponent of Dahl must lie between 1 and 2, got 0.5."),
    (lambda: BlimanSorine(0.1, 0.2, 0.5, 1e-6), "mu1 of BlimanSorine must be above mu2 = 0.2, got 0.1."),
    (lambda: BlimanSorine(0.1, -0.2, 0.5, 1e-6), "mu2 of BlimanSorine must not be negative, got -0.2."),
    (lambda: BlimanSorine(0.3, 0.2, 1.0, 1e-6), "eta of BlimanSorine must lie between 0 and 1, got 1.0."),
    (lambda: BlimanSorine(0.3, 0.2, 0.5, 0.0), "epsilon of BlimanSorine must be a positive number of m, got 0.0."),
    (lambda: LuGre(0.1, 0.05), "mu_s of LuGre must be at least mu = 0.1, got 0.05."),
    (lambda: LuGre(0.1, v_damping=0.0), "v_damping of LuGre must be a positive number of m/s, got 0.0."),
    (lambda: LuGre(0.1, sigma1=-1.0), "sigma1 of LuGre must not be negative, got -1.0 N s/m."),
    (
        lambda: ElastoPlastic(0.1, breakaway_fraction=1.0),
        "breakaway_fraction of ElastoPlastic must lie between 0 and 1, got 1.0.",
    ),
    (lambda: BoucWen(0.1, 1e5, 0.5), "n of BoucWen must be at least 1, got 0.5."),
    (lambda: BoucWen(0.1, 1e5, 1.0, 0.4), "beta of BoucWen must lie between 0.5 and 1, got 0.4."),
    (lambda: Rolling(0.1, 0.0), "length of Rolling must be a positive number of m, got 0.0."),
    (lambda: RateState(0.1, 0.0, 0.01, 1e-6), "a of RateState must be a positive number, got 0.0."),
    (lambda: RateStateSlip(0.1, 0.01, -0.01, 1e-6), "b of RateStateSlip must not be negative, got -0.01."),
]


@pytest.mark.parametrize(("build", "sentence"), REFUSED, ids=[sentence.split(" must")[0] for _, sentence in REFUSED])
def test_refused(build, sentence: str):
    with pytest.raises(ValueError) as refusal:
        build()
    assert str(refusal.value) == sentence
