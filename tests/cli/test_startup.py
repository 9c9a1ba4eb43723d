"""Help and refusals need few imports; processes end with the right code."""

import json
import subprocess
import sys

from fricjax.data.read import example_paths

_HEAVY = ("jax", "numpy", "pandas", "scipy", "matplotlib", "equinox", "pint", "h5py")
# Prints exit code and loaded packages after each command; commands are separated by a plus sign.
_LOADED = """
import sys
from fricjax.cli.main import run
for words in " ".join(sys.argv[1:]).split("+"):
    code = run(words.split())
    print("loaded", code, *[name for name in {heavy} if name in sys.modules])
"""


def python(code: str, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)


def loaded(heavy, *commands):
    """Run commands in one fresh process; return stdout, stderr and report."""
    done = python(_LOADED.format(heavy=heavy), "+".join(commands))
    assert done.returncode == 0, done.stderr
    return done, [line for line in done.stdout.splitlines() if line.startswith("loaded ")]


def test_help_imports_nothing_heavy():
    commands = ("--help", "fit --help", "demo --help", "report --help", "--version")
    _, reports = loaded(_HEAVY, *commands)
    assert reports == ["loaded 0"] * len(commands)


def test_a_column_that_is_not_there_is_refused_without_jax(tmp_path):
    run = tmp_path / "run.csv"
    run.write_text("t [s],x [um]\n" + "".join(f"{i / 100},{i}\n" for i in range(20)))
    commands = [
        f"{command} {run} --column y{f' --rig {example_paths()[1]}' if command == 'energy' else ''}"
        for command in ("fit", "inspect", "compare", "energy", "calibrate ringdown")
    ]
    done, reports = loaded(("jax", "equinox"), *commands)
    assert reports == ["loaded 4"] * len(commands)
    assert done.stderr.count("run.csv has no column 'y' (given by --column)") == len(commands)


def test_a_report_of_nothing_is_refused_before_numpy(tmp_path):
    done, reports = loaded(_HEAVY, f"report {tmp_path / 'fit.json'}")
    assert reports == ["loaded 4"]
    assert "There is no file or folder" in done.stderr


def test_a_process_ends_with_the_exit_code_and_pure_json():
    done = python("from fricjax.cli.main import main; main()", "fit", "no-such-run.csv", "--json")
    assert done.returncode == 4
    assert json.loads(done.stdout)["exit_code"] == 4
    assert done.stderr == ""


def test_a_reader_that_goes_away_is_no_failure():
    main = "from fricjax.cli.main import main; main()"
    command = f'{sys.executable} -c "{main}" calibrate interferometer | head -n 1; echo ${{PIPESTATUS[0]}}'
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
