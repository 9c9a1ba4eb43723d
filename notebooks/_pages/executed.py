"""The code blocks of a page: what they print and draw, run once and kept until the page or the package changes."""

import base64
import hashlib
import os
import re
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbformat import NotebookNode

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^(?P<indent> *)```python(?P<hidden> hidden)?\n(?P<code>.*?)^(?P=indent)```$", re.DOTALL | re.M)
FENCED = re.compile(r"^ *(`{3,}).*?^ *\1$", re.DOTALL | re.M)
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
PATIENCE = 900  # seconds for one block: the first fit of a law compiles, and the machine may be busy


class Failed(Exception):
    """A block has raised; the message names it and the error."""


def codes(markdown: str) -> list[str]:
    """The Python blocks of a page, in their order."""
    return [textwrap.dedent(found["code"]).strip() for found in BLOCK.finditer(markdown)]


def outputs(codes: list[str], store: Path) -> list[list[NotebookNode]]:
    """What each block shows: one list of outputs for each, as notebooks hold them.

    The blocks of a page are run in one kernel, one after the other, in a folder of their own.
    """
    kept = store / f"{_fingerprint(codes)}.ipynb"
    if not codes:
        return []
    if not kept.exists():
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code) for code in codes])
        with tempfile.TemporaryDirectory() as folder:
            place = {"metadata": {"path": folder}}
            # Kernels warn that they talk over TCP, as those of Jupyter do; the build has no secrets.
            quiet = ["--log-level=ERROR"]
            client = NotebookClient(
                notebook, timeout=PATIENCE, resources=place, extra_arguments=quiet, coalesce_streams=True
            )
            try:
                # How far a fit is concerns who waits for it, and no reader.
                client.execute(env=os.environ | {"FRICJAX_PROGRESS": "off"})
            except CellExecutionError as error:
                raise Failed(f"a code block fails.\n{COLOUR.sub('', str(error))}") from error
        store.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook, partial := kept.with_suffix(".tmp"))
        partial.replace(kept)
    return [cell.outputs for cell in nbformat.read(kept, as_version=4).cells]


def _fingerprint(codes: list[str]) -> str:
    """A name for these blocks under this state of the package."""
    parts = [*codes, *(path.read_text() for path in sorted((ROOT / "fricjax").rglob("*.py*")) if path.suffix != ".pyc")]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def with_outputs(
    markdown: str,
    shown: list[list[NotebookNode]],
    picture: Callable[[bytes], str],
    kept: Callable[[str], str],
) -> str:
    """A page with the outputs of its blocks below them, and without those blocks that are hidden.

    Args:
        markdown: the page.
        shown: outputs of each of its Python blocks.
        picture: stores a PNG and tells its path.
        kept: stores HTML and tells what stands for it.
    """
    rest = iter(shown)

    def block(found: re.Match[str]) -> str:
        *_, heading = ["Picture", *re.findall(r"^#+ (.*)$", FENCED.sub("", markdown[: found.start()]), re.M)]
        parts = [] if found["hidden"] else [f"```python\n{textwrap.dedent(found['code'])}```"]
        for output in next(rest):
            data = output.get("data", {})
            if page := data.get("text/html") or data.get("image/svg+xml"):
                parts.append(kept(page))
            elif "image/png" in data:
                name = picture(base64.b64decode(data["image/png"]))
                parts.append(f"![{heading.replace('`', '')}]({name}){{ .picture }}")
            elif text := data.get("text/plain") or (output.get("name") == "stdout" and output.text):
                parts.append(f"````{{ .text .output }}\n{text.rstrip()}\n````")
        return textwrap.indent("\n\n".join(parts), found["indent"])

    return BLOCK.sub(block, markdown)
