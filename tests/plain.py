"""Linter for plain English: `python -m tests.plain [PATH ...]` lists violations."""

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("fricjax", "experiments", "tests", "notebooks")
EXAMPLES = ("tests/plain.py", "tests/test_plain.py")
LONGEST_SUMMARY = 12
HARD = re.compile(
    r"\b(what\b(?![^.]*\?)|who|whoever|whose|told|tells|telling|untold"
    r"|(is|are|was|were) (asked|looked at|looked for|counted as|said of|taken for|held against|gone on)"
    r"|asked for|looked at|hangs on|lack|lacks|lacking|beside|in place of|anew|onwards|thereby|thereof|therein"
    r"|of (its|their|his) own|(by|for) (itself|themselves)|as good as|(may|might) as well|(that|those) which|all that"
    r"|(nothing|none|nobody|no one) (is|are|of|but))\b"
    r"|(?:^|(?<=[.;:] ))(Of (a|an|the|all|these|those|several|each)|Where|Whether)\b"
)


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield lines of Markdown text, or of strings and comments in Python."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        in_code = False
        for number, line in enumerate(text.splitlines(), 1):
            in_code ^= line.lstrip().startswith("```")
            if not in_code:
                yield number, line
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.STRING, tokenize.COMMENT, tokenize.FSTRING_MIDDLE):
            yield from enumerate(token.string.splitlines(), token.start[0])


def summaries(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line number and first line of each docstring."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first, *_ = (ast.get_docstring(node) or "").split("\n")
            yield (node.body[0].lineno if node.body else 1), first


def offences(path: Path) -> list[str]:
    """List the places in a file that break a rule."""
    place = str(path.relative_to(ROOT))
    hard = [f"{place}:{number}: '{hit[0]}'" for number, line in prose(path) for hit in HARD.finditer(line)]
    long = [
        f"{place}:{number}: the summary has {len(line.split())} words, more than {LONGEST_SUMMARY}"
        for number, line in (summaries(path) if path.suffix == ".py" else ())
        if len(line.split()) > LONGEST_SUMMARY
    ]
    return hard + long


def files() -> list[Path]:
    """Return all files with prose."""
    below = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".md")]
    return sorted({*ROOT.glob("*.md"), *below} - {ROOT / name for name in EXAMPLES})


if __name__ == "__main__":
    given = [Path(name).resolve() for name in sys.argv[1:]] or [ROOT]
    for path in files():
        if any(path.is_relative_to(each) for each in given):
            sys.stdout.writelines(f"{line}\n" for line in offences(path))
