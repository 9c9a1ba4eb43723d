"""Reference pages for the public modules, from the names in the stubs.

A stub (``__init__.pyi``) lists the names that a folder exports, with the module of each. We follow each name to the
definition of the object, because mkdocstrings reads the definition.
"""

import ast
import collections
import dataclasses
import functools
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "fricjax"
ROWS = "| name | |\n|---|---|\n"


@dataclasses.dataclass(frozen=True)
class Public:
    """A public object.

    Attributes:
        name: full name that users import.
        definition: full name of the definition.
        summary: first paragraph of the docstring.
    """

    name: str
    definition: str
    summary: str


@dataclasses.dataclass(frozen=True)
class Module:
    """A public module.

    Attributes:
        name: full name.
        summary: first paragraph of the docstring.
        objects: exported objects, without modules.
        has_stub: True if the module is a folder with a stub.
    """

    name: str
    summary: str
    objects: tuple[Public, ...]
    has_stub: bool


@functools.cache
def modules() -> list[Module]:
    """Return the package and all its public modules, sorted by name."""
    return sorted(_from("fricjax"), key=lambda module: module.name)


def _from(name: str) -> Iterator[Module]:
    exported = _exports(name)
    objects = tuple(_public(name, own) for own in exported if not _is_module(name, own))
    yield Module(name, _summary(ast.parse(_file(name).read_text())), objects, bool(exported))
    for own, source in exported.items():
        if _is_module(name, own) and source == name:
            yield from _from(f"{name}.{own}")


def _file(name: str) -> Path:
    path = PACKAGE.parent.joinpath(*name.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@functools.cache
def _exports(name: str) -> dict[str, str]:
    """Map each name in the stub of a folder to its module."""
    stub = _file(name).with_suffix(".pyi")
    nodes = ast.parse(stub.read_text()).body if stub.exists() else []
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    return {alias.name: ".".join(filter(None, (name, node.module))) for node in imports for alias in node.names}


def _is_module(name: str, own: str) -> bool:
    """Return True if an exported name is a module.

    A function may have the same name as its file.
    """
    source = _exports(name)[own]
    if source != name:
        return _exports(source).get(own) == source
    return _file(f"{name}.{own}").exists()


def _public(name: str, own: str) -> Public:
    source = _exports(name)[own]
    while own in _exports(source):
        source = _exports(source)[own]
    body = ast.parse(_file(source).read_text()).body
    # If a function has several signatures, the last one has the docstring.
    nodes = [node for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == own]
    return Public(f"{name}.{own}", f"{source}.{own}", _summary(nodes[-1]) if nodes else "")


def _summary(node: ast.Module | ast.FunctionDef | ast.ClassDef) -> str:
    """Format the first docstring paragraph as a Markdown table cell."""
    paragraph = (ast.get_docstring(node) or "").split("\n\n")[0]
    return " ".join(paragraph.split()).replace("|", r"\|").replace("``", "`")


@functools.cache
def names() -> dict[str, list[str]]:
    """Map each definition to all names of the object, shortest first."""
    found = collections.defaultdict(list)
    for public in sorted(
        (public for module in modules() for public in module.objects), key=lambda each: len(each.name)
    ):
        found[public.definition].append(public.name)
    return found


def index() -> str:
    """Write the first page: the names in `fricjax`, and the modules.

    It also contains the entries of objects that no other module exports.
    """
    package, *rest = modules()
    objects = [f"| [`{public.name}`][{public.name}] | {public.summary} |" for public in package.objects]
    below = [f"| [`{module.name}`]({module.name}.md) | {module.summary} |" for module in rest]
    own = [_entry(public) for public in package.objects if len(names()[public.definition]) == 1]
    promise = (
        "Every public name has an entry: arguments with shapes and units, errors, and an example that the tests run."
    )
    return "\n\n".join(
        (
            f"# Reference\n\n{promise}",
            "## Main names",
            ROWS + "\n".join(sorted(objects)),
            "## All modules",
            ROWS + "\n".join(below),
            *own,
        )
    )


def page(module: Module) -> str:
    """Write the page of a module, with an entry for each name."""
    if not module.has_stub:
        return f"# `{module.name}`\n\n::: {module.name}\n    options:\n      show_root_heading: false\n"
    # Base classes come last.
    ordered = sorted(module.objects, key=lambda public: (".Abstract" in public.name, public.name))
    entries = [_entry(public) for public in ordered]
    return f"# `{module.name}`\n\n{module.summary}\n\n{'\n'.join(entries)}"


def _entry(public: Public) -> str:
    """Write the directive from which mkdocstrings makes an entry.

    Each name of the object is an anchor for links from other pages.
    """
    first, *_ = known = names()[public.definition]
    anchors = "".join(f"[](){{#{name}}}\n" for name in known if name != public.definition)
    options = f'heading: "{first}"\n      toc_label: "{public.name.rpartition(".")[2]}"'
    return f"{anchors}\n::: {public.definition}\n    options:\n      {options}\n"
