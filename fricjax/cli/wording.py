"""Translation of Python arguments in messages to options of the command line.

Messages of the package name Python arguments: ``column=``, ``start='release'``. On the command line they name options:
``--column``, ``--start release``. The options come from the declarations of the command.
"""

import inspect
import re
from collections.abc import Iterable, Mapping
from typing import get_args

# Arguments of the package with an option of another name.
_OTHERWISE = {"overwrite": "force", "priors": "prior", "names": "free"}
# Text to keep: quoted words, calls in a log, and the value after an option.
_KEPT = r"(?<![\w=])'[^'\n]*'(?!\w)|\b\w+\((?:[^()]|\([^()]*\))*\)|--[a-z][\w-]*(?: \S+)?"
_VALUE = r"'[^']*'|\"[^\"]*\"|\[[^\]]*\]|\([^)]*\)|[A-Z]\w*\([^)]*\)|[-+\w.]*[-+\w]"

# Options of the running command. This is global because messages, also those of warnings, do not know their command.
_options: dict[str, str] = {}


def speak(options: Mapping[str, str]) -> None:
    """Set the options for later messages, by argument name."""
    _options.clear()
    _options.update(options)


def options_of(parameters: Iterable[inspect.Parameter]) -> dict[str, str]:
    """Return the options of a command by parameter name."""
    options: dict[str, str] = {}
    for parameter in parameters:
        for declared in get_args(parameter.annotation)[1:]:
            if type(declared).__name__ == "OptionInfo":
                # Of `--held-out/--no-held-out`, use the first.
                names = [word.partition("/")[0] for word in declared.param_decls or () if word.startswith("--")]
                options[parameter.name] = names[0] if names else f"--{parameter.name.replace('_', '-')}"
    return options | {
        name: options[other] for name, other in _OTHERWISE.items() if other in options and name not in options
    }


def in_options(sentence: str) -> str:
    """Replace arguments of the package by options of the running command."""
    if not _options:
        return sentence
    names = "|".join(sorted(_options, key=len, reverse=True))
    # The longest name comes first, because one name may be the beginning of another.
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
    # Convert Python values to words of a shell: 'release', ['mu', 'damping'], Pendulum().
    if value[:1] in ("[", "("):
        value = ",".join(re.findall(r"'([^']*)'", value)) or '""'
    elif value[:1] in ("'", '"'):
        text = value[1:-1]
        value = f'"{text}"' if not text or re.search(r"\s", text) else text
    elif value.endswith(")"):
        value = value.partition("(")[0].lower()
    return f"{option} {value}".rstrip()
