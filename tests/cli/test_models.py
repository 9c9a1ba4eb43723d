"""The catalogue of friction laws on the command line."""

import inspect
import json
from typing import Any

import pytest

from fricjax import friction

LAWS: dict[str, Any] = {
    name.lower(): law
    for name, law in vars(friction).items()
    if inspect.isclass(law) and not inspect.isabstract(law) and law is not friction.Sum
}


def test_the_catalogue_holds_every_law(fricjax):
    told = json.loads(fricjax("models", "--json").out)["models"]
    assert {entry["name"] for entry in told} == set(LAWS)
    only_python = {entry["name"] for entry in told if not entry["on_command_line"]}
    assert only_python == {"maxwellslip", "generalisedmaxwellslip", "leuven", "spline", "monotonespline"}


@pytest.mark.parametrize("name", sorted(LAWS))
def test_a_law_tells_all_of_itself(name, fricjax):
    entry = json.loads(fricjax("models", "show", name, "--json").out)
    assert [c["name"] for c in entry["coefficients"]] == list(LAWS[name].coefficients)
    assert all(c["about"] for c in entry["coefficients"])
    assert entry["source"] and entry["identifies"].endswith(".")
    assert "`" not in entry["about"] + "".join(entry["details"])
    page = fricjax("models", "show", name).out
    assert f"{entry['engine']} engine" in page
    assert "A free decay tells: " in page


def test_an_unknown_law_is_named_with_its_neighbour(fricjax):
    done = fricjax("models", "show", "lugr")
    assert done.code == 2
    assert "There is no friction law 'lugr'. Did you mean 'lugre'?" in done.err
