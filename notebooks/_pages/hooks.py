"""What the build adds to the pages: tutorials, reference, outputs of code, formulas, navigation."""

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
# Pages that name everything would be the first answer to every search.
UNSEARCHED = "---\nsearch:\n  exclude: true\n---\n\n"
CARDS = "<!-- tutorials -->"
_html: list[str] = []
_cards: list[str] = []


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Fills the navigation: each notebook is a tutorial, each public module a page of the reference."""
    tutorials = [f"{path.stem}.md" for path in TUTORIALS]
    modules: list = ["reference/index.md", *(f"reference/{module.name}.md" for module in reference.modules()[1:])]
    filled = {"Tutorials": tutorials, "Reference": modules}
    config.nav = [{name: filled.get(name, part)} for entry in config.nav for name, part in entry.items()]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages that are made, and runs the code of all pages, some side by side."""
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
    """What the code of a page shows."""
    try:
        return executed.outputs(executed.codes(markdown), STORE) if _runs(uri) else []
    except executed.Failed as failure:
        raise PluginError(f"{uri}: {failure}") from failure


def _tutorial(path: Path) -> str:
    """The Markdown of a notebook, with a link to the notebook itself; links between notebooks lead to their pages."""
    cells = jupytext.read(path).cells
    # Blocks within the text are to be read: as `py` they look the same, and are not run.
    parts = [
        f"```python\n{cell.source}\n```" if cell.cell_type == "code" else cell.source.replace("```python", "```py")
        for cell in cells
    ]
    text = "\n\n".join(parts)
    text = re.sub(r"\]\((\d\d_\w+)\.(?:ipynb|py)", r"](\1.md", text)
    title, rest = text[text.index("# ") :].split("\n", 1)
    return f"{title}\n\n[The notebook itself]({path.stem}.ipynb){{ download .notebook }}\n{rest}"


def _card(name: str, text: str) -> str:
    """What the front page says of a tutorial: its title, and the question with which it begins."""
    title, *paragraphs = (" ".join(part.split()) for part in text.split("\n\n") if part.strip())
    first = next(part for part in paragraphs if part[0] not in "[#`!")
    question = re.match(r"\*\*(.+?)\*\*", first)
    sentence = question[1] if question else re.split(r"(?<=[.?!])\s", first, maxsplit=1)[0]
    return f"-   **[{title.removeprefix('# ')}]({name})**\n\n    {sentence}\n"


def _runs(uri: str) -> bool:
    """Whether the code of a page is run: that of the reference is run by the tests of the package's examples."""
    return not uri.startswith(("reference/", "changes", "contributing"))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Puts what the code blocks print and draw below them, and leaves out those that are hidden."""
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
    """A place for HTML that the Markdown of the page must not touch."""
    _html.append(text)
    return f"@@html {len(_html) - 1}@@"


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Formulas become MathML, which browsers show without a script; HTML of outputs goes to its places."""
    content = FORMULA.sub(lambda found: _mathml(found[2], found[1]), content)
    return PLACE.sub(lambda found: f'<div class="output">{_html[int(found[1])]}</div>', content)


def _mathml(formula: str, tag: str) -> str:
    return convert(html.unescape(formula).strip(), display="block" if tag == "div" else "inline")
