"""Fit problems that are built but not solved, for tests of internals."""

from typing import Any

from fricjax import Oscillator, Record, Trace
from fricjax.estimation.loss import named_loss
from fricjax.fitting.parameters import Request
from fricjax.fitting.problem import Problem, build_problem


def problem_of(data: Record | Trace | list, oscillator: Oscillator, free: tuple[str, ...], **options: Any) -> Problem:
    """Return the problem that `fit` solves for the same arguments."""
    request: dict[str, Any] = {
        "oscillator": oscillator, "free": free, "nuisance": None, "engine": "auto", "start": "first_reversal",
        "bounds": {}, "priors": {}, "tie": {}, "rig": None, "guess": {}, "loss": "squares", **options,
    }  # fmt: skip
    request["loss"] = named_loss(request["loss"])
    return build_problem(data if isinstance(data, list) else [data], Request(**request))
