"""Code blocks of README and documentation, run as a reader would."""

import ast
import contextlib
import io
import re
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(
    r"^(?P<indent> *)```(?P<language>\w+)[^\n]*\n(?P<code>.*?)^(?P=indent)```$", re.DOTALL | re.MULTILINE
)


class Ran(NamedTuple):
    """Output of code blocks: printed text, and the values of last lines."""

    printed: str
    shown: list[Any]


def blocks(markdown: str, language: str) -> list[str]:
    """Return the fenced blocks of a language in order, without indentation."""
    return [textwrap.dedent(hit["code"]) for hit in BLOCK.finditer(markdown) if hit["language"] == language]


def run(codes: list[str], name: str) -> Ran:
    """Run blocks in one namespace; errors name block and line."""
    namespace: dict[str, Any] = {"__name__": "__main__"}
    printed, shown = io.StringIO(), []
    with contextlib.redirect_stdout(printed):
        for number, code in enumerate(codes, 1):
            place = f"<block {number} of {name}>"
            *body, last = ast.parse(code).body
            if not isinstance(last, ast.Expr):
                body.append(last)
            exec(compile(ast.Module(body, []), place, "exec"), namespace)
            if isinstance(last, ast.Expr):
                shown.append(eval(compile(ast.Expression(last.value), place, "eval"), namespace))
    return Ran(printed.getvalue(), shown)


def commands(markdown: str) -> list[str]:
    """Return the commands of shell blocks, without comments and virtual environment."""
    lines = [line.partition("#")[0] for code in blocks(markdown, "sh") for line in code.splitlines()]
    parts = [part.strip() for line in lines for part in line.split(" && ")]
    return [part.removeprefix(".venv/bin/") for part in parts if part]
