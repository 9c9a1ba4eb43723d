"""Options that several commands share, declared once.

A command takes a group of options as one argument, a frozen dataclass whose fields are annotated as options. `grouped`
shows typer the fields and gives the command the dataclass, so that names, help texts and defaults are the same
everywhere.
"""

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints

from .wording import options_of, speak


def example(words: str) -> str:
    """The line of a help page that shows how the command is used."""
    return f"Example: fricjax {words.strip()}"


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command whose dataclass arguments are spread into one option per field."""
    parameters = inspect.signature(command).parameters
    groups: dict[str, Any] = {
        name: p.annotation for name, p in parameters.items() if dataclasses.is_dataclass(p.annotation)
    }

    @functools.wraps(command)
    def spread(**given: Any) -> Any:
        speak(options)
        made = {name: group(**{field: given.pop(field) for field in _fields(group)}) for name, group in groups.items()}
        return command(**given, **made)

    shown: list[inspect.Parameter] = []
    for name, parameter in parameters.items():
        shown += _fields(groups[name]).values() if name in groups else [parameter.replace(kind=parameter.KEYWORD_ONLY)]
    options = options_of(shown)
    spread.__signature__ = inspect.Signature(shown)  # type: ignore[attr-defined]
    spread.__annotations__ = {parameter.name: parameter.annotation for parameter in shown}
    return spread


def _fields(group: type) -> dict[str, inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return {field.name: _parameter(field, hints[field.name]) for field in dataclasses.fields(group)}


def _parameter(field: dataclasses.Field, annotation: Any) -> inspect.Parameter:
    default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
    return inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
