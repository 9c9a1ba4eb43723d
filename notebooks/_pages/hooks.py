"""MkDocs hooks that add tutorials, reference, outputs, formulas and navigation."""

import html
import itertools
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import executed
import jupytext
import reference
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
STORE = ROOT / "build" / "pages"
TUTORIALS = sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.py"))
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
PLACE = re.compile(r"<p>@@html (\d+)@@</p>")
# These pages contain so many words that they would lead the results of every search.
UNSEARCHED = "---\nsearch:\n  exclude: true\n---\n\n"
CARDS = "<!-- tutorials -->"
_html: list[str] = []
_cards: list[str] = []


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the tutorials and the pages of the reference to the navigation."""
    tutorials = [f"{path.stem}.md" for path in TUTORIALS]
    modules: list = ["reference/index.md", *(f"reference/{module.name}.md" for module in reference.modules()[1:])]
    filled = {"Tutorials": tutorials, "Reference": modules}
    config.nav = [{name: filled.get(name, part)} for entry in config.nav for name, part in entry.items()]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and run all page code in parallel."""
    made = {f"{path.stem}.md": _tutorial(path) for path in TUTORIALS}
    _cards[:] = [_card(name, text) for name, text in made.items()]
    made["changes.md"] = UNSEARCHED + (ROOT / "CHANGELOG.md").read_text()
    made["contributing.md"] = UNSEARCHED + (ROOT / "CONTRIBUTING.md").read_text()
    made["reference/index.md"] = reference.index()
    made |= {f"reference/{module.name}.md": reference.page(module) for module in reference.modules()[1:]}
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    if config.extra["run"]:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(lambda file: _outputs(file.src_uri, file.content_string), files.documentation_pages()))
    return files


def _outputs(uri: str, markdown: str) -> list[list]:
    """Return the outputs of the code blocks of a page."""
    try:
        return executed.outputs(executed.codes(markdown), STORE) if _runs(uri) else []
    except executed.Failed as failure:
        raise PluginError(f"{uri}: {failure}") from failure


def _tutorial(path: Path) -> str:
    """Convert a notebook to Markdown, with a link for its download.

    Links to other notebooks become links to their pages.
    """
    cells = jupytext.read(path).cells
    # Blocks within the text must not run. As `py` they look the same.
    parts = [
        f"```python\n{cell.source}\n```" if cell.cell_type == "code" else cell.source.replace("```python", "```py")
        for cell in cells
    ]
    text = "\n\n".join(parts)
    text = re.sub(r"\]\((\d\d_\w+)\.(?:ipynb|py)", r"](\1.md", text)
    title, rest = text[text.index("# ") :].split("\n", 1)
    return f"{title}\n\n[Download the notebook]({path.stem}.ipynb){{ download .notebook }}\n{rest}"


def _card(name: str, text: str) -> str:
    """Format the front-page entry of a tutorial: title and question."""
    title, *paragraphs = (" ".join(part.split()) for part in text.split("\n\n") if part.strip())
    first = next(part for part in paragraphs if part[0] not in "[#`!")
    question = re.match(r"\*\*(.+?)\*\*", first)
    sentence = question[1] if question else re.split(r"(?<=[.?!])\s", first, maxsplit=1)[0]
    return f"-   **[{title.removeprefix('# ')}]({name})**\n\n    {sentence}\n"


def _runs(uri: str) -> bool:
    """Return True if the build runs the code of a page.

    The tests of the package run the examples of the reference.
    """
    return not uri.startswith(("reference/", "changes", "contributing"))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Insert the outputs of the code blocks, and remove the hidden blocks."""
    if not _runs(page.file.src_uri):
        return markdown
    markdown = markdown.replace(CARDS, f'<div class="grid cards" markdown>\n\n{"\n".join(_cards)}\n</div>')
    shown = _outputs(page.file.src_uri, markdown) if config.extra["run"] else [[] for _ in executed.codes(markdown)]
    stem = page.file.src_uri.removesuffix(".md")
    numbers = itertools.count(1)

    def picture(data: bytes) -> str:
        name = f"pictures/{stem}-{next(numbers)}.png"
        files.append(File.generated(config, name, content=data))
        return name

    return executed.with_outputs(markdown, shown, picture, _kept)


def _kept(text: str) -> str:
    """Store HTML that Markdown must not change, and return its placeholder."""
    _html.append(text)
    return f"@@html {len(_html) - 1}@@"


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Convert formulas to MathML, and insert the stored HTML of outputs.

    Browsers show MathML without a script.
    """
    content = FORMULA.sub(lambda found: _mathml(found[2], found[1]), content)
    return PLACE.sub(lambda found: f'<div class="output">{_html[int(found[1])]}</div>', content)


def _mathml(formula: str, tag: str) -> str:
    return convert(html.unescape(formula).strip(), display="block" if tag == "div" else "inline")
