"""The catalogue of friction laws on the command line."""

import json

from tests.helpers import EXPORTED_LAWS
from tests.tables import check_rows

LAWS = {name.lower(): law for name, law in EXPORTED_LAWS.items() if name != "Sum"}


def test_the_catalogue_holds_every_law(fricjax):
    models = json.loads(fricjax("models", "--json").out)["models"]
    assert {entry["name"] for entry in models} == set(LAWS)
    only_python = {entry["name"] for entry in models if not entry["on_command_line"]}
    assert only_python == {"maxwellslip", "generalisedmaxwellslip", "leuven", "spline", "monotonespline"}


def test_each_law_is_described(fricjax):
    def check(name):
        entry = json.loads(fricjax("models", "show", name, "--json").out)
        assert [c["name"] for c in entry["coefficients"]] == list(LAWS[name].coefficients)
        assert all(c["about"] for c in entry["coefficients"])
        assert entry["source"] and entry["identifies"].endswith(".")
        assert "`" not in entry["about"] + "".join(entry["details"])
        page = fricjax("models", "show", name).out
        assert f"{entry['engine']} engine" in page
        assert "From a free decay: " in page

    check_rows(check, sorted(LAWS))


def test_an_unknown_law_is_named_with_its_neighbour(fricjax):
    done = fricjax("models", "show", "lugr")
    assert done.code == 2
    assert "There is no friction law 'lugr'. Did you mean 'lugre'?" in done.err


OUT_OF_BOUNDS = [
    ("elastoplastic", "mu=0.1,sigma0=-3", "sigma0 of ElastoPlastic must be a positive number of N/m, got -3.0."),
    ("stribeck", "mu=0.1,mu_s=0.05", "mu_s of Stribeck must be at least mu = 0.1, got 0.05."),
    (
        "stribeck",
        "mu=0.1,mu_s=0.2,v_stribeck=0",
        "v_stribeck of Stribeck must be a positive number of m/s, got 0.0.",
    ),
    ("makkar", "gamma1=0.1,gamma2=1,gamma3=2,gamma4=0.1,gamma5=10", "gamma2 of Makkar must be above gamma3"),
]


def test_a_coefficient_out_of_its_bounds_is_one_sentence(fricjax):
    def check(law, given, sentence):
        words = ("--mass", "1", "--stiffness", "100", "--normal-force", "1", "--fix", f"damping=0,{given}")
        done = fricjax("simulate", "--friction", law, *words, "--x0", "1e-3", "--rate", "1000", "--duration", "1")
        assert done.code == 2
        assert f"Error: {sentence}" in done.err.replace("\n", " ")

    check_rows(check, OUT_OF_BOUNDS)
