"""`fricjax report` writes a page, or refuses in one sentence."""

import json

import pytest

from fricjax.data.read import example_paths
from tests.tables import check_rows


@pytest.fixture(scope="module")
def folder(fricjax, tmp_path_factory):
    """Fit the example run and save the fit."""
    made = tmp_path_factory.mktemp("report")
    run, rig = example_paths()
    assert fricjax("fit", run, "--rig", rig, "--out", made / "fit.json", "--quiet").code == 0
    return made


def test_the_page_of_a_fit(fricjax, folder):
    called = fricjax("report", folder / "fit.json", "--out", folder / "fit.html", "--title", "A & B")
    assert called.code == 0
    assert (
        called.out.strip()
        == f"{folder / 'fit.html'} shows the fit {folder / 'fit.json'} in any browser, without a network."
    )
    text = (folder / "fit.html").read_text()
    assert text.startswith("<!doctype html>") and "<title>A &amp; B</title>" in text
    refused = fricjax("report", folder / "fit.json", "--out", folder / "fit.html")
    assert refused.code == 2 and "it exists already. Add --force, or give another name." in refused.err
    report = json.loads(fricjax("report", folder / "fit.json", "--out", folder / "fit.html", "--force", "--json").out)
    assert report["kind"] == "fit" and report["bytes"] == (folder / "fit.html").stat().st_size
    assert report["files"] == {"page": str(folder / "fit.html")}


REFUSED = [
    ("nothing.json", "a.html", 4, "There is no file or folder"),
    (".", "a.html", 4, "holds no archive: there is no study.json in it"),
    ("fit.json", "a.pdf", 2, "--out cannot write 'a.pdf': give it the ending .html or .htm."),
    ("fit.html", "a.html", 4, "is neither an archive nor a fit. Give the folder that fricjax batch wrote"),
    ("study/study.json", "a.html", 4, "is a part of an archive. Give its folder"),
]


def test_other_sources_and_targets_are_refused(fricjax, folder):
    (folder / "study").mkdir()
    (folder / "study" / "study.json").write_text("{}")
    (folder / "fit.html").touch()

    def check(source, out, code, words):
        called = fricjax("report", folder / source, "--out", out)
        assert (called.code, called.out) == (code, "")
        assert words in called.err
        assert called.err.count("\n") == 1

    check_rows(check, REFUSED)
