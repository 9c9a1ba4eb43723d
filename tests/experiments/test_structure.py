"""Counts of imports, helpers, comments and words stay within limits."""

import ast
from collections import Counter

from experiments.structure import run

SOURCES = {path: path.read_text() for path in sorted(run.PACKAGE.rglob("*.py"))}
TREES = {path: ast.parse(source) for path, source in SOURCES.items()}
THOUSANDS = sum(source.count("\n") for source in SOURCES.values()) / 1000


def test_no_module_imports_in_a_circle():
    assert not run.cycles(TREES)


def test_a_circle_inside_functions_is_seen():
    first, second = (run.PACKAGE / name for name in ("errors.py", "late.py"))
    trees = {first: "def f():\n    from .late import g", second: "from .errors import f"}
    assert run.cycles({path: ast.parse(source) for path, source in trees.items()}) == {"fricjax.errors", "fricjax.late"}


def test_every_public_object_has_an_example():
    assert not [name for name, text in run.public(TREES) if ">>>" not in text]


def test_few_helpers_are_used_once_and_comments_say_why():
    assert len(list(run.used_once(TREES))) / THOUSANDS <= 12
    assert sum(map(run.comments, SOURCES.values())) / THOUSANDS >= 20


def test_few_files_are_small():
    assert run.short(SOURCES) / len(SOURCES) <= 0.125


def test_only_the_settings_of_a_fit_and_the_numbers_of_a_rig_are_many():
    assert set(run.wide(TREES)) == {"fitting/estimate.py estimate", "fitting/fit.py fit", "rig/rig.py __init__"}


def test_no_retired_word():
    words = Counter(word for source in SOURCES.values() for word in run.retired_words(source))
    assert not words, words


def test_retired_words_are_seen():
    assert list(run.retired_words('found_it = np.eye(2)\n"a stroke"\nturning_points = held_out')) == ["found", "stroke"]
