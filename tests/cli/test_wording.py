"""Messages name options, and printed text contains no control characters."""

import contextlib
import inspect
import io
import json
import os
import subprocess
import sys
from typing import Annotated

import pytest
from typer import Option

from fricjax.cli import compare, energy, fit, output, wording
from fricjax.cli.failure import failure_of
from fricjax.cli.options import grouped
from fricjax.errors import DataError


@pytest.fixture
def speaking():
    """Return a function that selects the command of all messages."""

    def speak(command):
        wording.speak(wording.options_of(inspect.signature(grouped(command)).parameters.values()))

    yield speak
    wording.speak({})


SENTENCES = [
    ("no column 'x' (given by column=).", "no column 'x' (given by --column)."),
    ("column=7 was given", "--column 7 was given"),
    ("give delimiter=, decimal= and skip_rows=.", "give --delimiter, --decimal and --skip-rows."),
    ("use start='release'.", "use --start release."),
    ("Fit from the release: start='release'.", "Fit from the release: --start release."),
    ("free that too, nuisance=['x0', 'drift'].", "free that too, --nuisance x0,drift."),
    ("fix the offset (nuisance=()).", 'fix the offset (--nuisance "").'),
    ("fit with restoring=Cubic(0.0) with free=['mu', 'k3'].", "fit with --restoring cubic with --free mu,k3."),
    ("fit with friction=Dahl(...) or friction=LuGre(...).", "fit with --friction dahl or --friction lugre."),
    ("give column='my x'.", 'give --column "my x".'),
    ("'skip_rows='?", "'--skip-rows'?"),
    # Typed words, logs, and names that are no options stay unchanged.
    (
        "'rate=3' is none (see --fix mass=1 or --free mu,drag=2)",
        "'rate=3' is none (see --fix mass=1 or --free mu,drag=2)",
    ),
    ("read(column='x', rate=5): Coulomb's law", "read(column='x', rate=5): Coulomb's law"),
    ("such as mu_s=0.1, x.rate=1, in first_rate=2", "such as mu_s=0.1, x.rate=1, in first_rate=2"),
]


def test_arguments_become_options(speaking):
    speaking(fit.fit)
    assert {sentence: wording.in_options(sentence) for sentence, _ in SENTENCES} == dict(SENTENCES)


def test_only_options_of_the_command_are_named(speaking):
    speaking(energy.energy)
    assert wording.in_options("use start='release' or column=") == "use start='release' or --column"
    speaking(compare.compare)
    assert wording.in_options("held_out=True, held_out=False") == "--held-out, --no-held-out"
    wording.speak({})
    assert wording.in_options("column=") == "column="


def test_an_option_of_another_name_stands_for_its_argument(speaking):
    def command(force: Annotated[bool, Option("--force")] = False): ...

    speaking(command)
    assert wording.in_options("give overwrite=True to replace it") == "give --force to replace it"


def test_a_long_sentence_is_cut():
    message = failure_of(DataError("It has " + ", ".join(f"column {i}" for i in range(5000)))).message
    assert len(message) == 2000
    assert message.endswith(" ...")


EVIL = "a\x1b[31m\x07\x9b2J\u202eb\rc\udcff"


def test_what_a_terminal_would_obey_is_written_out():
    shown = output.visible(f"{EVIL}\td\n")
    assert shown == "a\\x1b[31m\\x07\\x9b2J\\u202eb\\rc\\udcff\td\n"
    as_json = output.json_text({"name": EVIL})
    assert json.loads(as_json)["name"] == EVIL
    assert output.visible(as_json) == as_json


def test_every_encoding_is_written_to():
    for encoding in ("ascii", "utf-8", "latin-1"):
        buffer = io.BytesIO()
        stream = io.TextIOWrapper(buffer, encoding=encoding, errors="strict", write_through=True)
        output.tell(stream, f"µ = 1 Ω {EVIL}")
        output.tell_json(stream, {"name": f"µΩ😀{EVIL}"})
        first, rest = buffer.getvalue().decode(encoding).split("\n", 1)
        assert "= 1 " in first
        assert json.loads(rest)["name"] == f"µΩ😀{EVIL}"


@pytest.mark.parametrize("encoding", ["ascii:strict", "utf-8:strict"])
def test_a_name_that_no_encoding_holds_is_no_traceback(tmp_path, encoding):
    code = "import sys; from fricjax.cli.main import run; run(sys.argv[1:]); run([*sys.argv[1:], '--json'])"
    done = subprocess.run(
        [sys.executable, "-c", code, "fit", os.fsencode("\udcff\x1b[31m\u00b5.csv")],
        env={**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "1"},
        cwd=tmp_path,
        capture_output=True,
    )
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr
    for printed in (done.stdout, done.stderr):
        assert b"is no name of a file" in printed
        assert b"\x1b" not in printed
    assert json.loads(done.stdout)["exit_code"] == 4


def test_a_column_with_escapes_is_told_as_they_are_written(fricjax, tmp_path):
    file = tmp_path / "run.csv"
    file.write_text("t,\x1b[31mred\n" + "\n".join(f"{0.01 * i},{(-1) ** i}" for i in range(20)))
    called = fricjax("inspect", file, "--column", "blue")
    assert "It has 't', '\\x1b[31mred'." in called.err
    assert "given by --column" in called.err


def test_log_lines_stay_lines():
    from fricjax.cli.options import Output

    err = io.StringIO()
    with contextlib.redirect_stderr(err):
        output.log(Output(), "Picture: a\nb\x1b.png")
    assert err.getvalue() == "Picture: a\\nb\\x1b.png\n"


def test_every_help_page_shows_an_example_that_is_understood(fricjax, tmp_path, monkeypatch):
    """The absent files are the only fault of an example."""
    monkeypatch.chdir(tmp_path)
    commands = [
        "inspect",
        "check",
        "fit",
        "compare",
        "map",
        "energy",
        "simulate",
        "calibrate ringdown",
        "calibrate frf",
    ]
    for command in commands:
        text = " ".join(fricjax(*command.split(), "--help").out.split())
        example = text.partition("Example: fricjax ")[2].strip()
        assert example.startswith(command)
        called = fricjax(*[word.strip('"') for word in example.replace('"2 mm"', "2mm").split()])
        assert "There is no" in called.err, (example, called)
    assert "Example: fricjax fit run.csv --rig rig.toml" in fricjax("--help").out
    assert "fricjax models lists all laws" in " ".join(fricjax("fit", "--help").out.replace("│", " ").split())
