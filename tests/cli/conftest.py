"""Call commands within the process of the tests."""

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from fricjax.cli.main import run


class Called(NamedTuple):
    """Exit code, stdout and stderr of a command."""

    code: int
    out: str
    err: str


def call(*arguments: object) -> Called:
    """Run `fricjax` with the given words."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(argument) for argument in arguments])
    return Called(code, out.getvalue(), err.getvalue())


@pytest.fixture(scope="session", autouse=True)
def _no_cache() -> Iterator[None]:
    """Keep the user's cache and the display of warnings unchanged."""
    shown = warnings.showwarning
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRICJAX_CACHE_DIR", "off")
        yield
    warnings.showwarning = shown


@pytest.fixture(scope="session")
def fricjax() -> Callable[..., Called]:
    """Return the function that calls a command: `fricjax("fit", "run.csv")`."""
    return call
