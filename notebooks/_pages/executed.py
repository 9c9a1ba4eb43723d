"""Run the code blocks of a page, and cache their outputs.

The cache is valid until the blocks or the package change.
"""

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
TIMEOUT = 900  # seconds per block: the first fit of a law compiles, and the machine may be busy


class Failed(Exception):
    """A code block has failed; the message shows block and error."""


def codes(markdown: str) -> list[str]:
    """Return the Python blocks of a page in their order."""
    return [textwrap.dedent(found["code"]).strip() for found in BLOCK.finditer(markdown)]


def outputs(codes: list[str], store: Path) -> list[list[NotebookNode]]:
    """Return the outputs of each block as notebook outputs.

    All blocks of a page run one after the other in the same kernel, in a new temporary folder.
    """
    kept = store / f"{_fingerprint(codes)}.ipynb"
    if not codes:
        return []
    if not kept.exists():
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code) for code in codes])
        with tempfile.TemporaryDirectory() as folder:
            place = {"metadata": {"path": folder}}
            # Kernels warn that they communicate over TCP, as all Jupyter kernels do; the build has no secrets.
            quiet = ["--log-level=ERROR"]
            client = NotebookClient(
                notebook, timeout=TIMEOUT, resources=place, extra_arguments=quiet, coalesce_streams=True
            )
            try:
                # Readers of the page need no progress bars.
                client.execute(env=os.environ | {"FRICJAX_PROGRESS": "off"})
            except CellExecutionError as error:
                raise Failed(f"a code block fails.\n{COLOUR.sub('', str(error))}") from error
        store.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook, partial := kept.with_suffix(".tmp"))
        partial.replace(kept)
    return [cell.outputs for cell in nbformat.read(kept, as_version=4).cells]


def _fingerprint(codes: list[str]) -> str:
    """Hash the blocks and the source of the package."""
    parts = [*codes, *(path.read_text() for path in sorted((ROOT / "fricjax").rglob("*.py*")) if path.suffix != ".pyc")]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def with_outputs(
    markdown: str,
    shown: list[list[NotebookNode]],
    picture: Callable[[bytes], str],
    kept: Callable[[str], str],
) -> str:
    """Insert the outputs below the blocks, and remove the hidden blocks.

    Args:
        markdown: the page.
        shown: outputs of each Python block of the page.
        picture: stores a PNG and returns its path.
        kept: stores HTML and returns a placeholder for it.
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
