"""Sentences of the package in the words of the command line.

The package words its advice for those who call it: ``column=``, ``start='release'``. Whoever typed a command reads the
options of that command instead. Which these are is taken from their declarations.
"""

import inspect
import re
from collections.abc import Iterable, Mapping
from typing import Any, get_args

# Arguments of the package that their options name otherwise.
_OTHERWISE = {"overwrite": "force", "priors": "prior", "names": "free"}
# What is no advice: words in quotes, the steps of a log as they were called, and what follows an option already.
_LEFT = r"(?<![\w=])'[^'\n]*'(?!\w)|\b\w+\((?:[^()]|\([^()]*\))*\)|--[a-z][\w-]*(?: \S+)?"
_VALUE = r"'[^']*'|\"[^\"]*\"|\[[^\]]*\]|\([^)]*\)|[A-Z]\w*\([^)]*\)|[-+\w.]*[-+\w]"

_options: dict[str, str] = {}


def speak(options: Mapping[str, str]) -> None:
    """Word sentences from now on with these options, each by the argument that it stands for."""
    _options.clear()
    _options.update(options)


def options_of(parameters: Iterable[inspect.Parameter]) -> dict[str, str]:
    """The options of a command by the names of its parameters, without those that are no options."""
    found: dict[str, str] = {}
    for parameter in parameters:
        for declared in get_args(parameter.annotation)[1:]:
            if type(declared).__name__ == "OptionInfo":
                found[parameter.name] = _option(parameter.name, declared)
    return found | {name: found[other] for name, other in _OTHERWISE.items() if other in found and name not in found}


def _option(name: str, declared: Any) -> str:
    names = [word.partition("/")[0] for word in declared.param_decls or () if word.startswith("--")]
    return names[0] if names else f"--{name.replace('_', '-')}"


def in_options(sentence: str) -> str:
    """The sentence with options in place of the arguments of the package, where the command has them."""
    if not _options:
        return sentence
    names = "|".join(sorted(_options, key=len, reverse=True))
    found = rf"'(?P<quoted>{names})='|(?P<left>{_LEFT})|(?<![\w.])(?P<name>{names})=(?P<value>{_VALUE})?"
    return re.sub(found, _reworded, sentence)


def _reworded(match: re.Match[str]) -> str:
    if match["quoted"]:
        return f"'{_options[match['quoted']]}'"
    if match["left"]:
        return match["left"]
    option, value = _options[match["name"]], match["value"] or ""
    if value in ("True", "False"):
        return option if value == "True" else f"--no-{option.removeprefix('--')}"
    return f"{option} {_written(value)}".rstrip()


def _written(value: str) -> str:
    """A value of the package as one types it: ``'release'``, ``['mu', 'damping']``, ``Pendulum()``."""
    if value[:1] in ("[", "("):
        words = re.findall(r"'([^']*)'", value)
        return ",".join(words) if words else '""'
    if value[:1] in ("'", '"'):
        text = value[1:-1]
        return f'"{text}"' if not text or re.search(r"\s", text) else text
    return value.partition("(")[0].lower() if value.endswith(")") else value
