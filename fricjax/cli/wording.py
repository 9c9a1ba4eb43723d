"""Sentences of the package in the words of the command line.

The package words its advice for those who call it: ``column=``, ``start='release'``. Whoever typed a command reads the
options of that command instead. Which these are is taken from their declarations.
"""

import inspect
import re
from collections.abc import Iterable, Mapping
from typing import get_args

# Arguments of the package that their options name otherwise.
_OTHERWISE = {"overwrite": "force", "priors": "prior", "names": "free"}
# What stays as it is, for it is no advice: words in quotes, steps of a log as they were called, what follows an option.
_KEPT = r"(?<![\w=])'[^'\n]*'(?!\w)|\b\w+\((?:[^()]|\([^()]*\))*\)|--[a-z][\w-]*(?: \S+)?"
_VALUE = r"'[^']*'|\"[^\"]*\"|\[[^\]]*\]|\([^)]*\)|[A-Z]\w*\([^)]*\)|[-+\w.]*[-+\w]"

# Of the command that runs, one in a process: sentences come from everywhere, also from warnings, and carry no context.
_options: dict[str, str] = {}


def speak(options: Mapping[str, str]) -> None:
    """Word sentences from now on with these options, each by the argument that it stands for."""
    _options.clear()
    _options.update(options)


def options_of(parameters: Iterable[inspect.Parameter]) -> dict[str, str]:
    """The options of a command by the names of its parameters, without those that are no options."""
    options: dict[str, str] = {}
    for parameter in parameters:
        for declared in get_args(parameter.annotation)[1:]:
            if type(declared).__name__ == "OptionInfo":
                # Of `--held-out/--no-held-out` the first is the one to advise.
                names = [word.partition("/")[0] for word in declared.param_decls or () if word.startswith("--")]
                options[parameter.name] = names[0] if names else f"--{parameter.name.replace('_', '-')}"
    return options | {
        name: options[other] for name, other in _OTHERWISE.items() if other in options and name not in options
    }


def in_options(sentence: str) -> str:
    """The sentence with options in place of the arguments of the package, where the command has them."""
    if not _options:
        return sentence
    names = "|".join(sorted(_options, key=len, reverse=True))
    # The longest name comes first, so that none is taken for the beginning of another.
    pattern = rf"'(?P<quoted>{names})='|(?P<kept>{_KEPT})|(?<![\w.])(?P<name>{names})=(?P<value>{_VALUE})?"
    return re.sub(pattern, _reworded, sentence)


def _reworded(match: re.Match[str]) -> str:
    if match["quoted"]:
        return f"'{_options[match['quoted']]}'"
    if match["kept"]:
        return match["kept"]
    option, value = _options[match["name"]], match["value"] or ""
    if value in ("True", "False"):
        return option if value == "True" else f"--no-{option.removeprefix('--')}"
    # Values of the package as one types them: 'release', ['mu', 'damping'], Pendulum().
    if value[:1] in ("[", "("):
        value = ",".join(re.findall(r"'([^']*)'", value)) or '""'
    elif value[:1] in ("'", '"'):
        text = value[1:-1]
        value = f'"{text}"' if not text or re.search(r"\s", text) else text
    elif value.endswith(")"):
        value = value.partition("(")[0].lower()
    return f"{option} {value}".rstrip()
