"""The reference: a page for each public module, with an entry for each name that the stubs export.

A stub (``__init__.pyi``) says which names a folder exports and from where; they are followed to where the object is
defined, which is what mkdocstrings reads.
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
    """A public object: what users call it, where it is defined, and the first paragraph of its docstring."""

    name: str
    definition: str
    summary: str


@dataclasses.dataclass(frozen=True)
class Module:
    """A module: its name, the first paragraph of its docstring, and what its stub exports beside modules."""

    name: str
    summary: str
    objects: tuple[Public, ...]
    has_stub: bool


@functools.cache
def modules() -> list[Module]:
    """The package and all its public modules, in the order of their names."""
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
    """Names that the stub of a folder exports, each with the module from which it comes."""
    stub = _file(name).with_suffix(".pyi")
    nodes = ast.parse(stub.read_text()).body if stub.exists() else []
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    return {alias.name: ".".join(filter(None, (name, node.module))) for node in imports for alias in node.names}


def _is_module(name: str, own: str) -> bool:
    """Whether an exported name is a module; a function may have the name of its file."""
    source = _exports(name)[own]
    if source != name:
        return _exports(source).get(own) == source
    return _file(f"{name}.{own}").exists()


def _public(name: str, own: str) -> Public:
    source = _exports(name)[own]
    while own in _exports(source):
        source = _exports(source)[own]
    body = ast.parse(_file(source).read_text()).body
    # Of a function with several signatures the last one has the docstring.
    nodes = [node for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == own]
    return Public(f"{name}.{own}", f"{source}.{own}", _summary(nodes[-1]) if nodes else "")


def _summary(node: ast.Module | ast.FunctionDef | ast.ClassDef) -> str:
    """The first paragraph of a docstring, as a cell of a table of Markdown holds it."""
    paragraph = (ast.get_docstring(node) or "").split("\n\n")[0]
    return " ".join(paragraph.split()).replace("|", r"\|").replace("``", "`")


@functools.cache
def names() -> dict[str, list[str]]:
    """All names of each object, by its definition, the shortest first."""
    found = collections.defaultdict(list)
    for public in sorted(
        (public for module in modules() for public in module.objects), key=lambda each: len(each.name)
    ):
        found[public.definition].append(public.name)
    return found


def index() -> str:
    """The first page: what stands in `fricjax` itself, the modules, and entries of what no module has."""
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
            "## What one types most",
            ROWS + "\n".join(sorted(objects)),
            "## All modules",
            ROWS + "\n".join(below),
            *own,
        )
    )


def page(module: Module) -> str:
    """The page of a module: what it is about, and an entry for each of its names."""
    if not module.has_stub:
        return f"# `{module.name}`\n\n::: {module.name}\n    options:\n      show_root_heading: false\n"
    # What others derive from is looked for last.
    ordered = sorted(module.objects, key=lambda public: (".Abstract" in public.name, public.name))
    entries = [_entry(public) for public in ordered]
    return f"# `{module.name}`\n\n{module.summary}\n\n{'\n'.join(entries)}"


def _entry(public: Public) -> str:
    """What mkdocstrings makes an entry of; each name of the object is an anchor that pages may link to."""
    first, *_ = known = names()[public.definition]
    anchors = "".join(f"[](){{#{name}}}\n" for name in known if name != public.definition)
    options = f'heading: "{first}"\n      toc_label: "{public.name.rpartition(".")[2]}"'
    return f"{anchors}\n::: {public.definition}\n    options:\n      {options}\n"
