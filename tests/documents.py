"""The code blocks of README and documentation: found in their Markdown, and run as a reader would."""

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
    """What blocks left behind: all that they print, and the values that a notebook would show below each."""

    printed: str
    shown: list[Any]


def blocks(markdown: str, language: str) -> list[str]:
    """The fenced blocks of a language, in their order and without what indents them."""
    return [textwrap.dedent(hit["code"]) for hit in BLOCK.finditer(markdown) if hit["language"] == language]


def run(codes: list[str], name: str) -> Ran:
    """Runs blocks one after the other in one namespace; an error names the block and its line."""
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
    """The commands in the blocks of a shell, without their remarks and their virtual environment."""
    lines = [line.partition("#")[0] for code in blocks(markdown, "sh") for line in code.splitlines()]
    parts = [part.strip() for line in lines for part in line.split(" && ")]
    return [part.removeprefix(".venv/bin/") for part in parts if part]
