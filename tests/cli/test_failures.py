"""Bad input ends with one sentence, an exit code, and no files."""

import json

import numpy as np
import pytest

from fricjax.cli.failure import failure_of
from fricjax.data.read import example_paths
from tests.helpers import python_in
from tests.tables import check_rows

RUN, RIG = example_paths()
WITH_RIG = (RUN, "--rig", RIG)


def table(t, x, head="Time [s],Displacement [mm]") -> str:
    return "\n".join([head, *(f"{a!r},{b!r}" for a, b in zip(map(float, t), map(float, x), strict=True))])


@pytest.fixture
def files(tmp_path):
    """Write records that cannot be used, and a sound one."""
    t = np.arange(400) / 1000
    x = 2 * np.exp(-3 * t) * np.cos(2 * np.pi * 12.6 * t)
    missing, backwards, short = t.copy(), t.copy(), t < 0.07
    missing[17], backwards[20] = np.nan, t[18]
    texts = {
        "nan_time.csv": table(missing, x),
        "backwards.csv": table(backwards, x),
        "two.csv": table(t[:2], x[:2]),
        "constant.csv": table(t, np.full(400, 0.5)),
        "units.csv": table(t, x, "Time [s],Displacement [kg]"),
        "short.csv": table(t[short], x[short]),
        "good.csv": table(t, x),
        "words.csv": "one two three\nfour five six\n",
        "two.txt": "t,left,right\n" + "\n".join(f"{a},{b},{b}" for a, b in zip(t, x, strict=True)),
        "alone.csv": "x\n" + "\n".join(map(str, x)),
        "rise.csv": table(t, 1 - np.exp(-10 * t)),
        "empty.csv": "",
        "run.xyz": "1 2 3",
        "rig.toml": "mass = -0.4\nstiffness = 2574\nnormal_force = 9.66\n",
        "broken.toml": "mass = \n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return tmp_path


# tests/cli/test_refusals.py holds refusals that need no large import.
DATA = [
    (("nothing.csv",), "There is no file"),
    (("good.csv", "--column", "Displacment"), "Did you mean 'Displacement'?"),
    (("nan_time.csv",), "the time is nan (NaN, infinite or missing)"),
    (("backwards.csv",), "the time is not increasing (0.018 after 0.019)"),
    (("two.csv",), "at least 3"),
    (("constant.csv",), "x is constant"),
    (("units.csv",), "The unit 'kg' does not fit the displacement"),
    (("short.csv",), "with the offset free friction is undetermined from fewer than two"),
    (("good.csv", "--crop", "5:9"), "Only 0 samples lie between 5 s and 9 s"),
    (("words.csv",), "or give --delimiter, --decimal and --skip-rows."),
    (("two.txt",), "; name one with --column."),
    (("good.csv", "--column", "7"), "has 2 columns, but --column 7 was given"),
    (("alone.csv",), "has no time for 'x'; give --rate (samples per second) or --time (a column)."),
    (("rise.csv",), "Fit from the release: --start release."),
]
USAGE = [
    (("--rig", "rig.toml"), "mass must be a positive number of kg, got -0.4."),
    (
        ("--rig", RIG, "--free", "mu,normal_force"),
        "mu and normal_force cannot both be free, for they are not identifiable",
    ),
    (
        ("--friction", "coulomb+quadraticdrag", "--free", "mu,quadratic_drag,drag,stiffness"),
        "drag cannot be free together with a quadratic-drag law",
    ),
    (("--bounds", "dampin=0:"), "Did you mean 'damping'?"),
    (("--engine", "smooth"), "The smooth engine cannot integrate the jump of Coulomb."),
    (
        ("--engine", "exact", "--friction", "stribeck", "--fix", "mu_s=0.02"),
        "The exact engine knows Coulomb friction only",
    ),
    (("--sigma-mode", "relative"), "There is no sigma_mode 'relative'."),
    (("--plot", "fit.gif"), "--plot cannot write 'fit.gif': give it the ending .png or .svg or .pdf."),
    (("--out", "nowhere/fit.json"), "there is no folder 'nowhere'. Make it first."),
    (("--frobnicate",), "No such option: --frobnicate"),
    (("--rate", "fast"), "Invalid value for '--rate'"),
]


def check_failure(fricjax, folder, monkeypatch, words, sentence, code):
    """Check sentence and code as text and JSON; the folder stays unchanged."""
    monkeypatch.chdir(folder)
    before = sorted(path.name for path in folder.iterdir())
    out = () if "--out" in words else ("--out", "fit.json")
    plot = () if "--plot" in words else ("--plot", "fit.png")
    called = fricjax("fit", *words, *out, *plot, "--save", "record.npz", "--quiet")
    assert called.code == code, called
    assert called.out == ""
    assert sentence in " ".join(called.err.split())
    assert "Traceback" not in called.err
    as_json = fricjax("fit", *words, *out, *plot, "--json")
    assert as_json.code == code
    report = json.loads(as_json.out)
    assert sentence in report["error"]
    assert (report["kind"], report["exit_code"]) == ({2: "usage", 4: "data"}[code], code)
    assert "\n" not in report["error"]
    assert not python_in(report["error"])
    assert sorted(path.name for path in folder.iterdir()) == before


def test_rejected_data_end_with_four(fricjax, files, monkeypatch):
    def check(words, sentence):
        check_failure(fricjax, files, monkeypatch, words, sentence, 4)

    check_rows(check, DATA)


def test_wrong_usage_ends_with_two(fricjax, files, monkeypatch):
    def check(words, sentence):
        check_failure(fricjax, files, monkeypatch, ("good.csv", *words), sentence, 2)

    check_rows(check, USAGE)


def test_inspect_rejects_the_same(fricjax, files, monkeypatch):
    monkeypatch.chdir(files)
    for name, sentence in (("constant.csv", "x is constant"), ("nothing.csv", "There is no file")):
        called = fricjax("inspect", name)
        assert called.code == 4
        assert sentence in called.err


SIMULATE = [
    (("--x0", "2 mm"), "Coulomb friction needs mu"),
    (("--fix", "mu=0.02"), "Missing option '--x0'"),
    (("--fix", "mu=0.02", "--x0", "2 kg"), "The unit 'kg' does not fit --x0"),
    (("--fix", "mu=0.02", "--x0", "2 mm", "--noise", "-1"), "noise"),
    (("--fix", "mu=0.02", "--x0", "2 mm", "--rate", "1"), "make rate or duration larger"),
    (("--fix", "mu=0.02,v_s=1e-5", "--friction", "tanh", "--x0", "2 mm"), "say with --duration how long to watch"),
    (("--fix", "mu=0.02,damping=1000", "--x0", "2 mm"), "--duration"),
]


def test_simulate_refuses(fricjax, tmp_path):
    def check(words, sentence):
        called = fricjax("simulate", "--rig", RIG, *words, "--out", tmp_path / "run.csv")
        assert called.code == 2, called
        assert sentence in " ".join(called.err.split())
        assert list(tmp_path.iterdir()) == []

    check_rows(check, SIMULATE)


def test_an_unexpected_exception_is_one_line_with_a_hint(fricjax, monkeypatch):
    from fricjax import data

    def broken(*_, **__):
        raise ZeroDivisionError("division by zero\nand more")

    monkeypatch.setattr(data, "inspect", broken)
    called = fricjax("inspect", RUN)
    assert called.code == 5
    assert called.err.startswith(
        "Error: Unexpected ZeroDivisionError: division by zero\nThis is a fault of the program"
    )
    assert "Traceback" not in called.err
    assert "Traceback" in fricjax("inspect", RUN, "--debug").err
    assert json.loads(fricjax("inspect", RUN, "--json").out)["kind"] == "internal"


def test_commands_and_no_command(fricjax):
    assert fricjax("frob").code == 2
    assert "No such command 'frob'" in fricjax("frob").err
    nothing = fricjax()
    assert nothing.code == 2
    assert "Usage: fricjax" in nothing.out + nothing.err


def test_an_interrupt_is_no_traceback():
    failure = failure_of(KeyboardInterrupt())
    assert (failure.kind, failure.exit_code) == ("interrupted", 130)


def test_an_interrupted_command_says_so_also_in_json(fricjax, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("fricjax.data.inspect", interrupted)
    assert fricjax("inspect", RUN) == (130, "", "Error: Interrupted; nothing more was written.\n")
    report = json.loads(fricjax("inspect", RUN, "--json").out)
    assert (report["kind"], report["exit_code"]) == ("interrupted", 130)


def test_a_file_that_cannot_be_written_is_named():
    failure = failure_of(PermissionError(13, "Permission denied", "/x/fit.json"))
    assert (failure.text, failure.exit_code) == ("Error: '/x/fit.json' cannot be used: Permission denied.", 5)
