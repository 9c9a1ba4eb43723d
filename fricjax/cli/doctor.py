"""``fricjax doctor``: check the installation."""

import platform
import time
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from typer import Exit

from .failure import INCOMPLETE
from .options import Output
from .output import finish, prepare, working

_LOADED, _COMPILED = "/jax/compilation_cache/cache_hits", "/jax/compilation_cache/cache_misses"
_PACKAGES = (
    "jax",
    "jaxlib",
    "equinox",
    "diffrax",
    "optimistix",
    "lineax",
    "numpy",
    "scipy",
    "h5py",
    "pandas",
    "matplotlib",
)

# Packages that each extra needs.
_EXTRAS = {
    "formats": ("openpyxl", "nptdms", "pyarrow", "pyuff", "asammdf"),
    "batch": ("pyarrow", "duckdb", "distributed", "cryptography", "xarray", "h5netcdf"),
    "bayes": ("numpyro", "arviz"),
    "sens": ("SALib",),
    "interchange": ("xarray", "uncertainties", "lmfit"),
    "notebooks": ("jupyterlab", "jupytext", "ipywidgets"),
}
# File created by the NVIDIA driver, even if JAX cannot use the card.
_CARD = Path("/dev/nvidia0")


def doctor(output: Output) -> None:
    """Check the installation.

    The command shows versions, precision, devices, cache and extras. It computes a known motion and a small fit.
    """
    with working(output, "Checking"):
        prepare(output)
        findings = {"versions": versions(), **platform_facts()}
        # JAX reports the use of the cache of compiled programs only during a computation.
        from jax import monitoring

        seen: Counter[str] = Counter()
        monitoring.register_event_listener(lambda event, **_: seen.update([event]))
        checks = {check.__name__: _timed(check) for check in (golden_motion, tiny_fit)}
    findings["cache"] = {**cache_facts(), "loaded": seen[_LOADED], "compiled": seen[_COMPILED]}
    checks["double_precision"] = {"ok": findings["x64"], "detail": "jax computes in 64 bits", "seconds": 0.0}
    healthy = all(check["ok"] for check in checks.values())
    sentence = "All is well." if healthy else "Something is wrong: see the failed checks."
    data = {"schema": "fricjax.doctor/1", **findings, "checks": checks, "healthy": healthy, "verdict": sentence}
    finish(output, data, _text(findings, checks, sentence))
    if not healthy:
        raise Exit(INCOMPLETE)


def versions() -> dict[str, str]:
    """Return the versions of this package, Python and the numerical packages."""
    from importlib.metadata import PackageNotFoundError, version

    from .. import __version__

    versions = {"fricjax": __version__, "python": platform.python_version()}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "missing"
    return versions


def platform_facts() -> dict[str, Any]:
    """Return precision, devices, file formats and extras."""
    import jax

    from ..data.read import SUFFIXES

    return {
        "x64": bool(jax.config.read("jax_enable_x64")),
        "devices": [str(device) for device in jax.devices()],
        "formats": list(SUFFIXES),
        "extras": {extra: not missing(extra) for extra in _EXTRAS},
    }


def missing(extra: str) -> list[str]:
    """List the missing packages of an extra, without importing any."""
    return [name for name in _EXTRAS[extra] if find_spec(name) is None]


def cache_facts() -> dict[str, Any]:
    """Return facts about the folder of compiled programs.

    The entries are the folder, its number of files, and their size [bytes].
    Another one, `doubt`, is a reason not to trust the folder, or None.
    """
    import jax

    from ..oscillator.cache import asked_folder, distrust

    named = jax.config.jax_compilation_cache_dir
    folder = Path(named) if named else asked_folder()
    doubt = None if folder is None else distrust(folder)
    if not named or not Path(named).is_dir():
        return {"folder": None, "entries": 0, "bytes": 0, "doubt": doubt}
    sizes = [path.stat().st_size for path in Path(named).iterdir() if path.is_file()]
    return {"folder": str(named), "entries": len(sizes), "bytes": sum(sizes), "doubt": doubt}


def _timed(check: Any) -> dict[str, Any]:
    """Run a check; report an exception as a failure."""
    started = time.perf_counter()
    try:
        ok, detail = check()
    except Exception as error:
        ok, detail = False, f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
    return {"ok": ok, "detail": detail, "seconds": round(time.perf_counter() - started, 3)}


def golden_motion() -> tuple[bool, str]:
    """Check a motion with a known result.

    A mass of 1 kg on 5000 N/m under mu = 0.1, released at 3 mm, makes eight half-cycles and rests at -0.1392 mm.
    """
    import numpy as np

    from ..friction import Coulomb
    from ..oscillator import Oscillator, simulate

    # In closed form, the mass rests at 3 mm - 8 (2 mu N/k), after 8 pi sqrt(m/k).
    motion = simulate(Oscillator(1.0, 5000.0, 0.0, 9.81, Coulomb(0.1)), 3e-3, np.array([0.5]))
    x, half_cycles = float(motion.x[0]), int(motion.n_half_cycles)
    ok = abs(x + 1.392e-4) < 1e-12 and half_cycles == 8 and abs(float(motion.t_stop) - 0.355430635053) < 1e-9
    return ok, f"{half_cycles} half-cycles, rest at {1e3 * x:.9f} mm (8 and -0.139200000 mm)"


def tiny_fit() -> tuple[bool, str]:
    """Check a fit of a short synthetic run.

    The fit must recover the friction within five standard errors.
    """
    from ..fitting import fit
    from ..friction import Coulomb
    from ..instrument import synthetic_run
    from ..oscillator import Oscillator

    truth = Oscillator(0.41, 2574.0, 0.18, 9.66, Coulomb(0.02))
    record = synthetic_run(truth, 2e-3, rate=1000.0, duration=0.3, noise=5e-9, seed=1)
    result = fit(record, truth, ("mu", "damping", "stiffness"), throw=False)
    mu, miss = result.values["mu"], abs(result.values["mu"] - 0.02) / result.std_errors["mu"]
    # With 300 samples the reduced chi^2 scatters by 0.08.
    ok = result.described and miss < 5 and 0.7 < result.chi2_reduced < 1.3
    return ok, f"mu = {mu:.8f} (0.02), off by {miss:.1f} standard errors, {result.status}"


def _text(findings: dict[str, Any], checks: dict[str, Any], sentence: str) -> str:
    cache = findings["cache"]
    rows = [
        *findings["versions"].items(),
        ("precision", "64 bits" if findings["x64"] else "32 bits"),
        ("devices", _devices_text(findings["devices"])),
        ("cache", _cache_text(cache)),
        ("formats", " ".join(findings["formats"])),
        *((f"extra {extra}", _extra_text(extra)) for extra in findings["extras"]),
    ]
    lines = [f"{name:<18}{value}" for name, value in rows] + [""]
    for name, check in checks.items():
        mark = "ok" if check["ok"] else "FAILED"
        lines.append(f"{name.replace('_', ' '):<18}{mark}: {check['detail']} ({check['seconds']:.1f} s)")
    return "\n".join([*lines, "", sentence])


def _extra_text(extra: str) -> str:
    """Return the state of an extra, and how to install missing packages."""
    lost = missing(extra)
    return f"without {', '.join(lost)}: pip install 'fricjax[{extra}]'" if lost else "installed"


def _devices_text(devices: list[str]) -> str:
    """Return the devices, and advice on an unused card."""
    unused = _CARD.exists() and not any("cuda" in device for device in devices)
    remedy = "; there is an NVIDIA card that JAX does not use: pip install 'jax[cuda13]'" if unused else ""
    return ", ".join(devices) + remedy


def _cache_text(cache: dict[str, Any]) -> str:
    if cache["folder"] is None:
        return f"off: {cache['doubt'] or 'FRICJAX_CACHE_DIR says so, or its folder cannot be written to'}"
    kept = f"{cache['folder']}, {cache['entries']} files, {cache['bytes'] / 2**20:.0f} MB"
    used = f"these checks loaded {cache['loaded']} programs from it and compiled {cache['compiled']}"
    return "; ".join([kept, used, *([f"beware, {cache['doubt']}"] if cache["doubt"] else [])])
