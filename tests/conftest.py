"""Fixtures and settings: double precision, shape checks, keys, measured files."""

import gc
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from fricjax.oscillator import cache

# Most of the time goes into compiling. Workers, the commands that tests start, and later runs share compiled programs
# in a folder next to the user's cache, or in the one that FRICJAX_CACHE_DIR names; with "off" in a temporary folder.
# jax reads these variables at import, so the first process sets them.
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
# Most programs run once or twice in a test, so quick compilation matters more than quick programs. XLA uses the last
# value of a flag, so flags of the caller win.
os.environ["XLA_FLAGS"] = f"--xla_backend_optimization_level=0 {os.environ.get('XLA_FLAGS', '')}"

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
    # Workers take files in the order of collection. By default xdist orders files by their number of tests, which would
    # put the longest test, the type check, at the end.
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the top-level tests first; they include the type check."""
    items.sort(key=lambda item: item.path.parent != ROOT / "tests")


def pytest_unconfigure() -> None:
    if _PROGRAMS is not None:
        _PROGRAMS.cleanup()


# Each compiled function maps memory. Linux allows 65,530 mappings in a process, and XLA crashes beyond that.
_MAPPINGS = Path("/proc/self/maps")
_MANY_MAPPINGS = 20_000


@pytest.fixture(scope="module", autouse=True)
def _few_mappings() -> Iterator[None]:
    """Drop compiled functions after a module if they hold many memory mappings."""
    yield
    if _MAPPINGS.is_file() and _MAPPINGS.read_bytes().count(b"\n") > _MANY_MAPPINGS:
        from fricjax.oscillator.program import forget_programs

        jax.clear_caches()
        forget_programs()
        gc.collect()


@pytest.fixture
def getkey() -> Callable[[], jax.Array]:
    """Return a function that yields a reproducible sequence of random keys."""
    keys = iter(range(2**31))
    return lambda: jax.random.key(next(keys))


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Set the chunk size to two, so few runs fill several chunks."""
    monkeypatch.setattr("fricjax.fitting.chunks.WIDTH", 2)


@pytest.fixture(scope="session")
def measured_data() -> Callable[[str], Path]:
    """Return a function that locates a file below FRICJAX_DATA, or skips."""
    folder = Path(os.environ.get("FRICJAX_DATA", ROOT.parent / "shared" / "data"))

    def locate(path: str) -> Path:
        if not (folder / path).is_file():
            pytest.skip(f"measured run {path} is not in {folder}: set FRICJAX_DATA to the folder that holds it")
        return folder / path

    return locate
