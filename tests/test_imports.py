"""Folders import in one direction only, and importing the root is cheap."""

import ast
import functools
import subprocess
import sys
from pathlib import Path

import pytest

import fricjax
from fricjax.data.read import FORMATS

PACKAGE = Path(__file__).resolve().parents[1] / "fricjax"
ORDER = [
    "errors",
    "numbers",
    "thresholds",
    "settings",
    "show",
    "data",
    "friction",
    "oscillator",
    "tables",
    "plain",
    "instrument",
    "rig",
    "estimation",
    "fitting",
]
ORDER += ["comparison", "machine", "calibrate", "pairs", "energy_loss", "uncertainty", "sensitivity", "archive"]
ORDER += ["report", "cli"]
TRACED = ("friction", "oscillator", "tables")
HOST_ONLY = {"matplotlib", "pandas", "scipy", "h5py", "pint", "typer", "rich", "pydantic", "uncertainties"}
HEAVY = ("pandas", "matplotlib", "scipy", "h5py", "pint")
FILES = sorted(PACKAGE.rglob("*.py"))


def module_name(file):
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(node, file):
    """Return the full names of everything that a statement imports."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = node.module or ""
    if node.level:
        package = file.relative_to(PACKAGE.parent).parent.parts
        base = ".".join((*package[: len(package) - node.level + 1], *([node.module] if node.module else [])))
    return [f"{base}.{alias.name}" for alias in node.names]


@functools.cache
def imports(file, *, top_level_only=False):
    """Return the imports of a file, optionally those at module level only."""
    tree = ast.parse(file.read_text())
    nodes = list(_loaded(tree.body)) if top_level_only else list(ast.walk(tree))
    return [name for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for name in imported(node, file)]


def _loaded(body):
    """Yield statements that run at import."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        for part in ("body", "orelse", "finalbody"):
            yield from _loaded(getattr(node, part, []))
        for handler in getattr(node, "handlers", []):
            yield from _loaded(handler.body)


KNOWN = {module_name(file) for file in FILES}


def modules_of_the_package(names):
    """Yield for each name the longest prefix that is a module."""
    for name in names:
        parts = name.split(".")
        found = next((".".join(parts[:n]) for n in range(len(parts), 0, -1) if ".".join(parts[:n]) in KNOWN), None)
        if found:
            yield found


def test_every_folder_has_its_place():
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert folders <= set(ORDER)
    assert {path.name for path in PACKAGE.glob("*.py")} == {
        "__init__.py",
        "errors.py",
        "numbers.py",
        "thresholds.py",
        "settings.py",
    }


@pytest.mark.parametrize("folder", ORDER)
def test_a_folder_imports_only_from_those_before_it(folder):
    allowed = set(ORDER[: ORDER.index(folder) + 1])
    wrong = [
        f"{module_name(file)} imports {target}"
        for file in FILES
        if folder in file.relative_to(PACKAGE).parts[:1]
        for target in modules_of_the_package(imports(file))
        if target.split(".")[1:] and target.split(".")[1] not in allowed
    ]
    assert not wrong


def test_estimation_knows_neither_records_nor_oscillators():
    files = [file for file in FILES if file.relative_to(PACKAGE).parts[0] == "estimation"]
    targets = {target for file in files for target in modules_of_the_package(imports(file))}
    outside = {target for target in targets if not target.startswith("fricjax.estimation")}
    assert outside == {"fricjax.errors", "fricjax.thresholds", "fricjax.settings", "fricjax.numbers"}


def test_no_circle_of_modules():
    graph = {module_name(file): set(modules_of_the_package(imports(file, top_level_only=True))) for file in FILES}
    graph = {name: targets - {name} for name, targets in graph.items()}
    while leaves := [name for name, targets in graph.items() if not targets & graph.keys()]:
        for name in leaves:
            del graph[name]
    assert not graph, f"these modules import one another in a circle: {sorted(graph)}"


@pytest.mark.parametrize("folder", TRACED)
def test_traced_folders_import_no_host_code(folder):
    names = {name.split(".")[0] for file in (PACKAGE / folder).rglob("*.py") for name in imports(file)}
    assert not names & HOST_ONLY


def test_heavy_packages_are_imported_inside_functions():
    # Only the reading process imports the readers of binary formats.
    apart = [PACKAGE / "data" / "readers" / f"{file_format.module}.py" for file_format in FORMATS.values()]
    apart += [PACKAGE / "data" / "readers" / f"{name}.py" for name in ("nodes", "matlab")]
    wrong = [
        f"{module_name(file)} imports {name}"
        for file in FILES
        if file not in apart and file.relative_to(PACKAGE).parts[0] not in ("cli", "report")
        for name in imports(file, top_level_only=True)
        if name.split(".")[0] in HEAVY
    ]
    assert not wrong


def test_a_binary_file_is_read_in_another_process(tmp_path):
    path = fricjax.write(fricjax.Record(x=[2e-3, 1e-3, 1.5e-3], rate=1e3), tmp_path / "run.h5")
    assert "h5py" not in loaded_after(f"import fricjax; fricjax.read({str(path)!r})")


def loaded_after(statement):
    """Return the modules that a statement loads in a fresh interpreter, silently."""
    code = f"import sys, io; out = sys.stdout; sys.stdout = io.StringIO(); {statement}\n"
    code += "assert not sys.stdout.getvalue(); out.write(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def test_the_root_is_light():
    loaded = loaded_after("import fricjax; fricjax.__version__; dir(fricjax)")
    assert not loaded & {"jax", "numpy", "equinox", "diffrax", *HOST_ONLY}


def test_every_public_name_is_there_and_stays_light():
    loaded = loaded_after("import fricjax; [getattr(fricjax, name) for name in fricjax.__all__]")
    assert "jax" in loaded
    assert not loaded & {"pandas", "matplotlib", "h5py", "pint", "typer", "rich", "pydantic"}


def test_double_precision_is_left_to_the_user():
    loaded_after("import fricjax, jax; fricjax.simulate; assert not jax.config.jax_enable_x64")


def test_the_stub_names_what_design_promises():
    assert {"fit", "read", "simulate", "synthetic_run", "Trace", "Rig", "friction"} <= set(fricjax.__all__)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        fricjax.no_such_name  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_a_name_misspelt_names_the_nearest():
    with pytest.raises(AttributeError, match=r"fricjax\.friction has no 'Coulumb'\. Did you mean 'Coulomb'\?"):
        fricjax.friction.Coulumb  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_an_engine_with_a_mesh_imports_no_solver():
    """Only tracing needs diffrax; a kept program does not."""
    engine = "import numpy; from fricjax.oscillator.engines.smooth import Smooth\n"
    engine += "Smooth().finer().on_mesh(numpy.arange(2.0), numpy.arange(2.0), 8)"
    assert not loaded_after(engine) & {"diffrax", "optimistix"}


@pytest.mark.slow
def test_a_fit_waits_for_nothing_that_it_does_not_use(tmp_path, monkeypatch):
    """A fit of a law without internal states compiles no program."""
    monkeypatch.setenv("FRICJAX_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    fit = """
import numpy as np, jax
jax.config.update("jax_enable_x64", True)
programs = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, *_, **__: programs.append(1) if "backend_compile" in event else None
)
import fricjax
machine = fricjax.Oscillator(0.4, 2500.0, 0.2, 10.0, fricjax.friction.Coulomb(0.05))
times = np.arange(400) / 2e3
swing = np.floor(times * np.sqrt(6250.0) / np.pi)
centre = np.where(swing % 2, -2e-4, 2e-4)
noise = 1e-9 * np.random.default_rng(0).normal(size=400)
x = centre + (1.8e-3 - 4e-4 * swing) * np.cos(times * np.sqrt(6250.0)) + noise
fricjax.fit((times, x), machine, ["mu", "damping", "stiffness"], throw=False)
assert not programs, programs
"""
    assert not loaded_after(fit) & {"diffrax", "scipy", "pandas", "matplotlib", "optimistix", "lineax"}
