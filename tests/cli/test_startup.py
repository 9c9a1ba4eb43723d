"""Asking for help must cost next to nothing, and a process must end with the code that the command gives."""

import json
import subprocess
import sys

import pytest

from fricjax.data.read import example_paths

_HEAVY = ("jax", "numpy", "pandas", "scipy", "matplotlib", "equinox", "pint", "h5py")
_HELP = """
import sys
from fricjax.cli.main import run
code = run(sys.argv[1:])
print([name for name in {heavy} if name in sys.modules])
sys.exit(code)
"""


def python(code: str, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "words", [("--help",), ("fit", "--help"), ("demo", "--help"), ("report", "--help"), ("--version",)]
)
def test_help_imports_nothing_heavy(words):
    done = python(_HELP.format(heavy=_HEAVY), *words)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("[]")


@pytest.mark.parametrize("command", ["fit", "inspect", "compare", "energy", "calibrate ringdown"])
def test_a_column_that_is_not_there_is_refused_without_jax(command, tmp_path):
    run = tmp_path / "run.csv"
    run.write_text("t [s],x [um]\n" + "".join(f"{i / 100},{i}\n" for i in range(20)))
    rig = ["--rig", str(example_paths()[1])] if command == "energy" else []
    done = python(_HELP.format(heavy=("jax", "equinox")), *command.split(), str(run), "--column", "y", *rig)
    assert done.returncode == 4
    assert "run.csv has no column 'y' (asked for with --column)" in done.stderr
    assert done.stdout.rstrip().endswith("[]")


def test_a_report_of_nothing_is_refused_before_numpy(tmp_path):
    done = python(_HELP.format(heavy=_HEAVY), "report", str(tmp_path / "fit.json"))
    assert done.returncode == 4
    assert "There is no file or folder" in done.stderr
    assert done.stdout.rstrip().endswith("[]")


def test_a_process_ends_with_the_exit_code_and_pure_json():
    done = python("from fricjax.cli.main import main; main()", "fit", "no-such-run.csv", "--json")
    assert done.returncode == 4
    assert json.loads(done.stdout)["exit_code"] == 4
    assert done.stderr == ""


def test_a_reader_that_goes_away_is_no_failure():
    command = (
        f'{sys.executable} -c "from fricjax.cli.main import main; main()" models | head -n 1; echo ${{PIPESTATUS[0]}}'
    )
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.stdout.split()[-1] == "0"
    assert "Traceback" not in done.stderr


def test_every_option_is_explained(fricjax):
    for command in ("demo", "inspect", "simulate", "fit", "models", "doctor"):
        text = fricjax(command, "--help").out
        assert "--json" in text
        assert "--quiet" in text
    text = fricjax("fit", "--help").out
    for option in ("--rig", "--friction", "--free", "--fix", "--bounds", "--prior", "--tie", "--nuisance", "--start"):
        assert option in text
    for option in ("--column", "--time", "--unit", "--rate", "--sigma", "--crop", "--restoring", "--drag", "--plot"):
        assert option in text
