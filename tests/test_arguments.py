"""Public functions refuse arguments of the wrong kind in their own words."""

import subprocess
import sys

import pytest

import fricjax as fj
from fricjax.errors import UsageError
from tests.machines import coulomb_run

from .arguments import FREE, MACHINE


def test_no_argument_raises_an_error_of_another_library():
    done = subprocess.run([sys.executable, "-m", "tests.arguments"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize("draws", [0, 10**12, "many", None, 1.5])
def test_a_resampling_takes_a_possible_number_of_draws(draws):
    found = fj.fit(coulomb_run(), MACHINE, FREE, throw=False)
    with pytest.raises(UsageError, match="draws"):
        fj.uncertainty.bootstrap(found, draws)
    with pytest.raises(UsageError, match="fit must be the Fit"):
        fj.uncertainty.bootstrap(draws, 100)
