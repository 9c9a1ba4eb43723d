"""The examples in docstrings print the output that they show."""

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "fricjax"
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if ">>> " in path.read_text()]
# Examples that compile a program of their law or sampler for seconds.
SLOW = [
    "archive/archive",
    "archive/driver",
    "calibrate/ringdown",
    "calibrate/ringdown_calibration",
    "comparison/compare",
    "comparison/result",
    "energy_loss/agreement",
    "energy_loss/force_fit",
    "fitting/moving_floor",
    "oscillator/engines/events",
    "pairs/final_displacement",
    "pairs/release",
    "sensitivity/campaign",
    "sensitivity/directions",
    "sensitivity/fisher",
    "sensitivity/optimal",
    "sensitivity/variance",
    "uncertainty/fitted",
    "uncertainty/hierarchy",
    "uncertainty/profiles",
    "uncertainty/resampling",
    "uncertainty/sampling",
]


def case(path):
    name = str(path.relative_to(PACKAGE).with_suffix(""))
    return pytest.param(path, id=name, marks=pytest.mark.slow if name in SLOW else ())


@pytest.mark.parametrize("path", [case(path) for path in FILES])
def test_the_examples_of_a_module(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    options = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    outcome = doctest.testmod(module, optionflags=options, extraglobs={"__name__": module.__name__})
    assert outcome.attempted and not outcome.failed


def test_slow_examples_exist():
    assert {PACKAGE / f"{name}.py" for name in SLOW} <= set(FILES)
