"""The README: one page, an example with its output, lines for CI."""

import os
import subprocess
import sys

from tests.documents import ROOT, blocks

README = (ROOT / "README.md").read_text()


def block(language, after=""):
    """Return the first fenced block of a language after a marker."""
    return blocks(README[README.index(after) :], language)[0]


def test_it_is_one_page():
    assert len(README.split()) <= 900


def test_the_example_prints_what_is_shown():
    code = block("python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 12
    environment = os.environ | {"JAX_PLATFORMS": "cpu"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=ROOT, capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    # The numerical error consists of rounding errors, which differ between processors.
    same = lambda text: [line for line in text.splitlines() if not line.startswith("numerics:")]
    assert same(done.stdout) == same(block("text"))


def test_the_commands_are_single_lines():
    for marker in ("<!-- demo -->", "<!-- test -->"):
        assert len(block("sh", marker).strip().splitlines()) == 1


def test_the_automatic_check_takes_its_line_from_the_readme(tmp_path):
    (tmp_path / ".ci").mkdir()
    script = tmp_path / ".ci" / "run"
    script.write_bytes((ROOT / ".ci" / "run").read_bytes())
    slow = tmp_path / ".venv" / "bin" / "python"
    slow.parent.mkdir(parents=True)
    slow.write_text('#!/bin/sh\necho "slow: $*"\n')
    slow.chmod(0o755)

    def outcome(code):
        line = f"${{PYTHON:-none}} -c 'exit({code})'"
        (tmp_path / "README.md").write_text(f"```sh\nfalse\n```\n<!-- test -->\n```sh\n{line}\n```\n")
        environment = os.environ | {"PYTHON": sys.executable}
        done = subprocess.run(["bash", str(script)], capture_output=True, text=True, env=environment)
        return done.returncode, done.stdout.splitlines()[1:]

    assert outcome(7) == (7, [])
    code, (line, ran) = outcome(0)
    assert code == 0 and line == "+ JAXTYPING_DISABLE=1 .venv/bin/python -m pytest -n 2 --dist loadfile -m slow"
    assert ran == "slow: -m pytest -n 2 --dist loadfile -m slow"
