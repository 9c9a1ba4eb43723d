"""The linter for plain English finds violations, and only those."""

from tests import plain


def test_hard_constructions_are_found(tmp_path, monkeypatch):
    monkeypatch.setattr(plain, "ROOT", tmp_path)
    (tmp_path / "page.md").write_text(
        "The record tells.\n```\nwhat lacks\n```\nWhat is it?\nOf a run nothing is left.\n"
    )
    found = [text.split(":")[1] for text in plain.offences(tmp_path / "page.md")]
    assert found == ["1", "6", "6"]
    (tmp_path / "code.py").write_text(
        '"""One."""\n\n\ndef f():\n    """' + "long " * 13 + '"""\n    return "a whose"  # told\n'
    )
    found = [text.split(":")[1] for text in plain.offences(tmp_path / "code.py")]
    assert found == ["6", "6", "5"]
