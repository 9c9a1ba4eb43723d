"""Count how easy the package is to read.

    python experiments/structure/run.py [FOLDER of the package ...]

A reader must remember every file, every helper and every word that no paper uses. A comment saves a guess, an example
saves a search. Each figure comes from the source alone. Its limit follows in brackets.
"""

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "fricjax"
SHORT, MANY = 60, 10
# Retired words with their replacements. CONTRIBUTING.md has the glossary. Words that the linter of prose rejects are
# joined from two parts.
RETIRED = {
    "found": "name of the object: segmentation, fit, covariance ...",
    "climb": "solve in stages",
    "on" + "wards": "continue",
    "terrain": "stage weights",
    "lane": "batch member",
    "landed": "solution",
    "abreast": "chunk",
    "to" + "ld": "determined, identifiable, reported",
    "tell" + "ing": "identifiable",
    "settle": "derive (quantities)",
    "settled": "derived quantities",
    "survey": "evaluation, evaluate",
    "look": "evaluation, evaluate",
    "verdict": "diagnostics, final status",
    "admission": "final status",
    "judged": "diagnosed",
    "pose": "build problem",
    "posed": "problem",
    "course": "reversals, planned motion",
    "stroke": "half-cycle",
    "turns": "reversals",
    "turning": "phase integration (turning points are the field's word)",
    "turned": "reversal",
    "standstill": "state at reversal",
    "carried": "transition, resolved",
    "landing": "switching",
    "closing": "secant steps",
    "given": "fixed, name of the object",
    "sharp": "set-valued limit",
    "forgets": "fading memory",
    "refinement": "step refinement",
    "remark": "warning",
    "own": "of the run, of the law",
    "held": "fixed, at bound, sticking",
    "idle": "without effect",
    "windage": "quadratic drag",
    "eye": "interferometer",
    "whole": "full, atomic",
}
# Only these words are rejected in strings. The others are ordinary English.
JARGON = (
    "climb",
    "on" + "wards",
    "terrain",
    "lane",
    "abreast",
    "tell" + "ing",
    "stroke",
    "standstill",
    "windage",
    "idle",
    "to" + "ld",
)
KEPT = re.compile(
    r"turning_(points?|times?)|held_out(_\w+)?|(file|module|package)notfounderror|optimum_found|step_refinement"
)


def main() -> None:
    roots = [Path(name).resolve() for name in sys.argv[1:]] or [PACKAGE]
    sources = {path: path.read_text() for root in roots for path in sorted(root.rglob("*.py"))}
    trees = {path: ast.parse(source) for path, source in sources.items()}
    lines = sum(source.count("\n") for source in sources.values())
    small = short(sources)
    commented = sum(map(comments, sources.values()))
    once = list(used_once(trees))
    documented = list(public(trees))
    without = [name for name, text in documented if ">>>" not in text]
    broad = list(wide(trees))
    words = Counter(word for source in sources.values() for word in retired_words(source))
    print(f"files                                   {len(sources):8d}  (190)")
    print(f"lines                                   {lines:8d}  (22500)")
    print(f"files below {SHORT} lines                    {100 * small / len(sources):7.0f} %  (12)")
    print(f"private functions used once / 1000 lines {1000 * len(once) / lines:7.1f}  (12)")
    print(f"full-line comments / 1000 lines         {1000 * commented / lines:8.1f}  (20)")
    print(f"functions of more than {MANY} parameters     {len(broad):8d}  (3)  {', '.join(broad)}")
    print(f"modules in cycles of imports            {len(cycles(trees)):8d}  (0)  {' '.join(sorted(cycles(trees)))}")
    print(f"public objects without an example       {len(without):8d}  (0) of {len(documented)}")
    print(f"retired words                           {sum(words.values()):8d}  (0)  {dict(words.most_common())}")


def comments(source: str) -> int:
    """Count comments on separate lines."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return sum(token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip() for token in tokens)


def short(sources: dict[Path, str]) -> int:
    """Count files with few lines."""
    return sum(source.count("\n") < SHORT for source in sources.values())


def wide(trees: dict[Path, ast.Module]) -> Iterator[str]:
    """Yield functions with too many parameters."""
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                of = node.args
                if len([*of.posonlyargs, *of.args, *of.kwonlyargs]) > MANY:
                    yield f"{path.parent.name}/{path.name} {node.name}"


def used_once(trees: dict[Path, ast.Module]) -> Iterator[str]:
    """Yield private functions that their module uses only once."""
    for path, tree in trees.items():
        names = Counter(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("_") and names[node.name] == 1:
                yield f"{path.name}:{node.name}"


def public(trees: dict[Path, ast.Module]) -> Iterator[tuple[str, str]]:
    """Yield objects that a stub exports, with all their docstrings.

    Objects are functions and classes. The docstrings of methods are included.
    """
    exported = {
        (path.parent.joinpath(*(node.module or "").split(".")).with_suffix(".py"), alias.name)
        for path in PACKAGE.rglob("__init__.pyi")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    for path, tree in trees.items():
        # The last signature of an overloaded function has the docstring.
        defined = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        for node in defined.values():
            if (path, node.name) in exported:
                documented = [part for part in ast.walk(node) if isinstance(part, ast.FunctionDef | ast.ClassDef)]
                yield f"{path.name}:{node.name}", " ".join(ast.get_docstring(part) or "" for part in documented)


def cycles(trees: dict[Path, ast.Module]) -> set[str]:
    """Find modules that import one another in a circle.

    Imports inside functions and for types count as well.
    """
    names = {_module(path): path for path in trees if path.name != "__init__.py"}
    graph = {name: set(_imports(path, trees[path], names)) - {name} for name, path in names.items()}
    while free := [name for name, targets in graph.items() if not targets & graph.keys()]:
        for name in free:
            del graph[name]
    # Modules that only lead into a circle still remain: remove them from the other end.
    while ends := [name for name in graph if not any(name in targets for targets in graph.values())]:
        for name in ends:
            del graph[name]
    return set(graph)


def _module(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)


def _imports(path: Path, tree: ast.Module, names: dict[str, Path]) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            package = path.relative_to(PACKAGE.parent).parent.parts
            base = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*base, *([node.module] if node.module else [])))
            yield from {base, *(f"{base}.{alias.name}" for alias in node.names)} & names.keys()


def retired_words(source: str) -> Iterator[str]:
    """Yield retired words in identifiers, and jargon in strings."""
    # `np.eye`, `contextlib.closing` and the SVG attribute `stroke` are allowed.
    source = re.sub(r'\bstroke(-\w+)?="', 'line="', re.sub(r"np\.eye\(|contextlib\.closing\(", "np.matrix(", source))
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NAME and not KEPT.fullmatch(token.string.strip("_").lower()):
            yield from (word for word in _words(re.sub(r"([A-Z])", r"_\1", token.string)) if word in RETIRED)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from (word for word in _words(node.value) if word in JARGON)


def _words(text: str) -> Iterator[str]:
    """Yield words in lower case, with retired plurals as singulars."""
    for word in re.findall("[a-z]+", text.lower()):
        yield word[:-1] if word.endswith("s") and word not in RETIRED and word[:-1] in RETIRED else word


if __name__ == "__main__":
    main()
