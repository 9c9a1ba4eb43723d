"""Shared ground of the tests: double precision, run-time shape checks of the traced folders, keys, measured files."""

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import jaxtyping  # noqa: E402

# Only the traced folders state array shapes; the host side is checked by pyright.
jaxtyping.install_import_hook(("fricjax.friction", "fricjax.oscillator"), "beartype.beartype")

import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]

settings.register_profile(
    "fricjax", deadline=None, max_examples=30, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("fricjax")


# Each compiled function maps memory, a process may have 65,530 mappings on Linux, and XLA crashes beyond that.
_MAPPINGS = Path("/proc/self/maps")
_MANY_MAPPINGS = 20_000


@pytest.fixture(scope="module", autouse=True)
def _few_mappings() -> Iterator[None]:
    """Compiled functions are let go at the end of a module once they hold many mappings of memory."""
    yield
    if _MAPPINGS.is_file() and _MAPPINGS.read_bytes().count(b"\n") > _MANY_MAPPINGS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture
def getkey() -> Callable[[], jax.Array]:
    """A function that returns a fresh random key at each call, the same sequence in every run."""
    keys = iter(range(2**31))
    return lambda: jax.random.key(next(keys))


@pytest.fixture(scope="session")
def measured_data() -> Callable[[str], Path]:
    """`measured_data("folder/file")`: the path of a measured run below FRICJAX_DATA, or the test is skipped."""
    folder = Path(os.environ.get("FRICJAX_DATA", ROOT.parent / "shared" / "data"))

    def locate(path: str) -> Path:
        if not (folder / path).is_file():
            pytest.skip(f"measured run {path} is not in {folder}: set FRICJAX_DATA to the folder that holds it")
        return folder / path

    return locate
