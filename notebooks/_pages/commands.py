"""Reference of the command line, generated from its declarations.

Run ``python notebooks/_pages/commands.py`` to write ``notebooks/cli.md``.
"""

import collections
import inspect
import re
import types
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_origin

import typer
from typer.models import ArgumentInfo, OptionInfo

from fricjax.cli.failure import CODES
from fricjax.cli.main import app

PAGE = Path(__file__).resolve().parents[1] / "cli.md"
SHARED = 3
"""Number of commands from which on the page describes a common option once."""
PLACEHOLDERS = {str: "TEXT", Path: "PATH", int: "INTEGER", float: "NUMBER"}
INTRODUCTION = """\
# Command line

This page lists all commands with their options. `fricjax COMMAND --help` shows the same text in a terminal. It is
generated from the program by `python notebooks/_pages/commands.py`.
"""
OUTPUT = """\
## Output

- Results go to stdout. Log, progress and warnings go to stderr.
- With `--json`, stdout contains one JSON object and no other text. See [JSON output](json.md).
- `--json` and `--quiet` switch off the log and the progress. `--quiet` also switches off warnings.
- An error is one sentence on stderr. With `--json`, the sentence is in the object on stdout as `error`.
- `--debug` adds the traceback of an unexpected error.
- Files are written only if an option names them, except for the default paths of `demo` and `report`. An existing file
  is replaced only with `--force`.
"""


class Row(NamedTuple):
    """A row of a table of options, with its help panel."""

    panel: str
    option: str
    value: str
    default: str
    meaning: str


class Command(NamedTuple):
    """A command: its words after ``fricjax``, its function, and its example."""

    name: str
    function: Callable[..., Any]
    example: str

    def declared(self, kind: type) -> dict[inspect.Parameter, Any]:
        """Return arguments or options with their declarations."""
        found = {}
        for parameter in inspect.signature(self.function).parameters.values():
            if get_origin(parameter.annotation) is Annotated and isinstance(get_args(parameter.annotation)[1], kind):
                found[parameter] = get_args(parameter.annotation)[1]
        return found

    @property
    def rows(self) -> list[Row]:
        """Return the rows of the options."""
        return [_row(*each) for each in self.declared(OptionInfo).items()]

    @property
    def purpose(self) -> list[str]:
        """Return the paragraphs of the help text."""
        return [_escaped(" ".join(part.split())) for part in (inspect.getdoc(self.function) or "").split("\n\n")]


def page() -> str:
    """Return the page as Markdown."""
    commands = list(_commands(app))
    counts = collections.Counter(row for command in commands for row in command.rows)
    shared = [row for row, count in counts.items() if count >= SHARED]
    root = Command("", app.registered_callback.callback, "")
    listed = [f"[`fricjax {each.name}`](#{_anchor(f'fricjax {each.name}')}) | {each.purpose[0]}" for each in commands]
    parts = [
        INTRODUCTION,
        _table("Command | Purpose", listed),
        f"Two options need no command:\n\n{_options(root.rows)}",
        OUTPUT,
        f"## Exit codes\n\n{_table('Code | Meaning', [f'{code} | {meaning}' for code, meaning in CODES.items()])}",
        "## Shared options\n\nMany commands have these options. The section of each command lists its groups.\n",
        *(f"### {panel}\n\n{_options(rows)}" for panel, rows in _by_panel(shared).items()),
        *(_section(command, shared) for command in commands),
    ]
    return "\n".join(parts)


def _commands(group: typer.Typer, before: str = "") -> Iterator[Command]:
    """Yield all commands, followed by those of the subgroups."""
    for each in group.registered_commands:
        yield Command(before + each.name, each.callback, (each.epilog or "").removeprefix("Example: "))
    for each in group.registered_groups:
        inner = each.typer_instance
        if inner.registered_callback is not None:
            yield Command(before + each.name, inner.registered_callback.callback, "")
        yield from _commands(inner, f"{before}{each.name} ")


def _section(command: Command, shared: list[Row]) -> str:
    """Return the section of one command."""
    arguments = command.declared(ArgumentInfo)
    required = [f"{row.option.strip('`')} {row.value.strip('`')}" for row in command.rows if row.default == "required"]
    usage = " ".join([f"fricjax {command.name}", *map(_placeholder, arguments), *required, "[OPTIONS]"])
    example = command.example or f"fricjax {command.name}"
    parts = [f"## `fricjax {command.name}`\n", *(f"{paragraph}\n" for paragraph in command.purpose)]
    parts.append(f"```text\nUsage:    {usage}\nExample:  {example}\n```\n")
    if arguments:
        cells = [f"`{_placeholder(each)}` | {_escaped(declared.help)}" for each, declared in arguments.items()]
        parts.append(_table("Argument | Meaning", cells))
    if own := [row for row in command.rows if row not in shared]:
        parts.append(_options(own))
    groups = []
    for panel, rows in _by_panel(row for row in command.rows if row in shared).items():
        link = f"[{panel}](#{_anchor(panel)})"
        complete = len(rows) == sum(row.panel == panel for row in shared)
        groups.append(link if complete else f"{link} ({', '.join(row.option for row in rows)})")
    return "\n".join([*parts, f"Shared options: {'; '.join(groups)}.\n"])


def _by_panel(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Group options by the panel of the help page."""
    panels = collections.defaultdict(list)
    for row in rows:
        panels[row.panel].append(row)
    return panels


def _options(rows: Iterable[Row]) -> str:
    """Return options as a table."""
    return _table("Option | Value | Default | Meaning", [" | ".join(row[1:]) for row in rows])


def _table(head: str, rows: Iterable[str]) -> str:
    """Return lines of cells as a table of Markdown."""
    rule = "|".join("---" for _ in head.split("|"))
    return "\n".join(f"| {row} |" for row in (head, *rows)).replace("\n", f"\n|{rule}|\n", 1) + "\n"


def _row(parameter: inspect.Parameter, declared: OptionInfo) -> Row:
    """Return the row of an option."""
    # In an annotation, typer stores the first name as the default of the declaration.
    stated = [words for words in (declared.default, *(declared.param_decls or ())) if str(words).startswith("--")]
    names = [name for words in stated for name in words.split("/")] or [f"--{parameter.name.replace('_', '-')}"]
    kind, repeated = _kind(parameter)
    value = "" if kind is bool else f"`{declared.metavar or PLACEHOLDERS[kind]}`{' (repeatable)' if repeated else ''}"
    default = f"`{parameter.default:g}`" if type(parameter.default) is float else f"`{parameter.default}`"
    if parameter.default is parameter.empty:
        default = "required"
    elif parameter.default in (None, "") or kind is bool:
        default = "on" if parameter.default else ""
    option = ", ".join(f"`{name}`" for name in names)
    return Row(declared.rich_help_panel or "", option, value, default, _escaped(declared.help))


def _kind(parameter: inspect.Parameter) -> tuple[type, bool]:
    """Return the type of a parameter, and True for a list."""
    declared = get_args(parameter.annotation)[0]
    if isinstance(declared, types.UnionType):
        declared = get_args(declared)[0]
    return (get_args(declared)[0], True) if get_origin(declared) is list else (declared, False)


def _placeholder(argument: inspect.Parameter) -> str:
    """Return the placeholder of an argument."""
    return argument.name.upper() + ("..." if _kind(argument)[1] else "")


def _anchor(heading: str) -> str:
    """Return the anchor of a heading."""
    return heading.lower().replace(" ", "-")


def _escaped(text: str | None) -> str:
    """Return plain text as Markdown."""
    return re.sub(r"([\\*|<\[\]`])", r"\\\1", text or "")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
