"""What the README promises: its first Python example runs by itself, and the automatic check runs its test line."""

import os
import subprocess
import sys

from tests.documents import ROOT, blocks

README = (ROOT / "README.md").read_text()


def block(language, after=""):
    """The first fenced block of a language behind a marker."""
    return blocks(README[README.index(after) :], language)[0]


def test_the_example_runs_and_finds_the_coefficient():
    code = block("python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 20
    environment = os.environ | {"JAX_PLATFORMS": "cpu"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=ROOT, capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    mu, statistical, combined = map(float, done.stdout.splitlines()[-1].split())
    assert abs(mu - 0.05) < 4 * statistical < 4 * combined
    # The normal force is known to 0.005/1.89.
    assert combined >= 0.05 * 0.005 / 1.89


def test_the_commands_are_single_lines():
    for marker in ("<!-- demo -->", "<!-- test -->"):
        assert len(block("sh", marker).strip().splitlines()) == 1


def test_the_automatic_check_takes_its_line_from_the_readme(tmp_path):
    (tmp_path / ".ci").mkdir()
    script = tmp_path / ".ci" / "run"
    script.write_bytes((ROOT / ".ci" / "run").read_bytes())
    (tmp_path / "README.md").write_text("```sh\nfalse\n```\n<!-- test -->\n```sh\n${PYTHON:-none} -c 'exit(7)'\n```\n")
    environment = os.environ | {"PYTHON": sys.executable}
    done = subprocess.run(["bash", str(script)], capture_output=True, text=True, env=environment)
    assert done.returncode == 7, done.stderr
    assert done.stdout == "+ ${PYTHON:-none} -c 'exit(7)'\n"
