"""Calling the command line within the process: exit code, stdout and stderr of one command."""

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from fricjax.cli.main import run


class Called(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str


def call(*arguments: object) -> Called:
    """Run ``fricjax`` with these words."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(argument) for argument in arguments])
    return Called(code, out.getvalue(), err.getvalue())


@pytest.fixture(scope="session", autouse=True)
def _no_cache() -> Iterator[None]:
    """Commands must not touch the user's cache, nor leave their wording of warnings behind."""
    shown = warnings.showwarning
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRICJAX_CACHE_DIR", "off")
        yield
    warnings.showwarning = shown


@pytest.fixture(scope="session")
def fricjax() -> Callable[..., Called]:
    """`fricjax("fit", "run.csv")`: exit code, stdout and stderr."""
    return call
