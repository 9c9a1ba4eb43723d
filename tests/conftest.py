"""Shared ground of the tests: double precision, run-time shape checks of the traced folders, keys, measured files."""

import gc
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from fricjax.oscillator import cache

# Most of the time goes into compiling. What one worker has compiled serves the other ones, the commands that tests
# start, and the next run, which compiles what has changed: programs are kept under all that they depend on. They lie
# beside those of the user, within the same bound, or where the user says; with FRICJAX_CACHE_DIR=off in a folder that
# goes with the run. Only the first process finds none named. jax reads these variables when it is imported.
_PROGRAMS = None
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    _asked = cache.asked_folder()
    _folder = None if _asked is None else _asked.with_name(f"{_asked.name}-tests")
    if _folder is None or not cache.made(_folder) or cache.distrust(_folder):
        _PROGRAMS = tempfile.TemporaryDirectory(prefix="fricjax-tests-")
        _folder = Path(_PROGRAMS.name)
    cache.prune(_folder)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(_folder)
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")

import jax  # noqa: E402

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


def pytest_configure(config: pytest.Config) -> None:
    # Workers take files in the order of collection: xdist would begin with those of most tests, and end with one worker
    # waiting for the other to check types, which is the longest test.
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The tests of no folder, among which is the check of types, come first."""
    items.sort(key=lambda item: item.path.parent != ROOT / "tests")


def pytest_unconfigure() -> None:
    if _PROGRAMS is not None:
        _PROGRAMS.cleanup()


# Each compiled function maps memory, a process may have 65,530 mappings on Linux, and XLA crashes beyond that.
_MAPPINGS = Path("/proc/self/maps")
_MANY_MAPPINGS = 20_000


@pytest.fixture(scope="module", autouse=True)
def _few_mappings() -> Iterator[None]:
    """Compiled functions are let go at the end of a module once they hold many mappings of memory."""
    yield
    if _MAPPINGS.is_file() and _MAPPINGS.read_bytes().count(b"\n") > _MANY_MAPPINGS:
        from fricjax.oscillator.program import forget_programs

        jax.clear_caches()
        forget_programs()
        gc.collect()


@pytest.fixture
def getkey() -> Callable[[], jax.Array]:
    """A function that returns a fresh random key at each call, the same sequence in every run."""
    keys = iter(range(2**31))
    return lambda: jax.random.key(next(keys))


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two problems fill a chunk: a few runs are solved as many are, and of an odd number the first alone."""
    monkeypatch.setattr("fricjax.fitting.chunks.WIDTH", 2)


@pytest.fixture(scope="session")
def measured_data() -> Callable[[str], Path]:
    """`measured_data("folder/file")`: the path of a measured run below FRICJAX_DATA, or the test is skipped."""
    folder = Path(os.environ.get("FRICJAX_DATA", ROOT.parent / "shared" / "data"))

    def locate(path: str) -> Path:
        if not (folder / path).is_file():
            pytest.skip(f"measured run {path} is not in {folder}: set FRICJAX_DATA to the folder that holds it")
        return folder / path

    return locate
