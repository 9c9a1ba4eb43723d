"""A path without a readable file is refused with a hint."""

import pytest

from fricjax.archive.study_file import read_study
from fricjax.data.files import check_distinct, check_file
from fricjax.errors import DataError, UsageError
from fricjax.rig import Rig
from tests.tables import check_rows


@pytest.fixture
def folder(tmp_path):
    for i in range(5):
        (tmp_path / f"run{i}.csv").write_text("t,x")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "deeper").mkdir()
    return tmp_path


HINTS = [
    ("rum3.csv", "Did you mean 'run"),
    ("none/run.csv", "for there is no folder"),
    (".", "is a folder, not a file; name one record in it; it holds "),
    ("deeper", "is a folder, not a file; name one record in it."),
    ("run*.csv", "is a pattern, not a file; it matches "),
    ("run[34].csv", "run3.csv, "),
    ("run[9]x.csv", "Did you mean 'run"),
    ("x?.csv", "and none that matches this pattern."),
    ("empty.csv", "empty.csv is empty: it holds no data at all."),
]


def test_what_is_wrong_and_what_to_type(folder):
    def check(name, sentence):
        with pytest.raises(DataError) as caught:
            check_file(folder / name)
        assert sentence in str(caught.value)

    check_rows(check, HINTS)


def test_only_some_of_many_files_are_named(folder):
    with pytest.raises(DataError) as caught:
        check_file(folder / "run*.csv")
    assert "run2.csv and 2 more." in str(caught.value) and "run3.csv" not in str(caught.value)


def test_one_file_counts_once(folder, monkeypatch):
    check_distinct([folder / "run0.csv", folder / "run1.csv"])
    with pytest.raises(UsageError, match=r"run0.csv is given twice: its samples would count twice\."):
        check_distinct([folder / "run0.csv", folder / "run0.csv"])
    (folder / "link.csv").symlink_to(folder / "run0.csv")
    with pytest.raises(UsageError, match=r"link.csv is given twice, also as .*run0.csv"):
        check_distinct([folder / "run0.csv", folder / "link.csv"])


SETTINGS = {"rig": Rig.from_toml, "study": read_study}
NOT_SETTINGS = {
    "absent": (None, "There is no {kind} file '.*settings.toml'. Did you mean 'setting.toml'"),
    "wide": ("# " + "x" * 1000, "settings.toml: this is no {kind} file: a line has more than 1000 characters"),
    "large": ("#\n" * 60_000, "settings.toml has 0.00012 GB, but at most 0.0001 GB are expected"),
    "deep": ("mass = " + "[\n" * 5000, "settings.toml: this is no {kind} file: its tables are nested too deeply"),
    "dotted": (".".join("a" * 400) + " = 1", "settings.toml: there is no key 'a' in a {kind} file"),
    "binary": ("\udcff\udcfe", "settings.toml: this is no valid TOML file: 'utf-8' codec"),
    "unfinished": ("mass = ", "settings.toml: this is no valid TOML file: Invalid value"),
}


def test_files_of_settings_are_refused_alike(tmp_path):
    (tmp_path / "setting.toml").touch()
    path = tmp_path / "settings.toml"

    def check(kind, text, sentence):
        path.unlink(missing_ok=True)
        if text is not None:
            path.write_bytes(text.encode("utf-8", "surrogateescape"))
        with pytest.raises(UsageError, match=sentence.format(kind=kind)):
            SETTINGS[kind](path)

    check_rows(check, {(kind, name): (kind, *row) for kind in SETTINGS for name, row in NOT_SETTINGS.items()})
