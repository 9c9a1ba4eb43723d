"""Documentation: build without warnings or network, and every public name."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from types import ModuleType
from urllib.parse import unquote, urlsplit

import pytest

import fricjax
from tests.documents import ROOT

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Documentation from `mkdocs build --strict`, without running the code of its pages."""
    folder = tmp_path_factory.mktemp("site")
    environment = os.environ | {"FRICJAX_PAGES_RUN": "false", "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


class Links(HTMLParser):
    """Anchors and links of a page, and the files it loads."""

    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loaded = {"", "__top"}, [], []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.anchors |= {values[name] for name in ("id", "name") if values.get(name)}
        target = values.get("href") or values.get("src")
        if target and (tag != "link" or values.get("rel") != "canonical"):
            (self.links if tag == "a" else self.loaded).append(target)


@pytest.fixture(scope="module")
def read(site):
    return {path: Links(path) for path in sorted(site.rglob("*.html"))}


def test_every_link_leads_somewhere(site, read):
    broken = []
    for path, page in read.items():
        for link in page.links + page.loaded:
            parts = urlsplit(link)
            if parts.scheme or path.name == "404.html":
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if not target.exists() or (target in read and parts.fragment not in read[target].anchors):
                broken.append(f"{path.relative_to(site)}: {link}")
    assert not broken


def test_no_page_needs_a_network(site, read):
    loaded = {target for page in read.values() for target in page.loaded}
    assert not [target for target in loaded if urlsplit(target).scheme not in ("", "data")]
    styles = [path.read_text() for path in (site / "assets").rglob("*.css")]
    assert not re.findall(r"(?:@import|url\()\s*[\"']?https?:", " ".join(styles))


def public_names(module):
    """Yield the full names of all exports, including those of submodules."""
    for name in getattr(module, "__all__", ()):
        value = getattr(module, name)
        if isinstance(value, ModuleType):
            if value.__name__ == f"{module.__name__}.{name}":
                yield from public_names(value)
        else:
            yield f"{module.__name__}.{name}"


def test_every_public_name_has_an_entry(read):
    anchors = {anchor for path, page in read.items() if path.parent.name == "reference" for anchor in page.anchors}
    names = set(public_names(fricjax))
    assert {"fricjax.fit", "fricjax.friction.Coulomb", "fricjax.uncertainty.budget"} <= names
    assert not names - anchors


def test_formulas_need_no_script(site):
    text = (site / "symbols.html").read_text()
    assert text.count("<math") > 20
    assert "arithmatex" not in text


def test_each_notebook_is_a_page(site):
    notebooks = [path.stem for path in (ROOT / "notebooks").glob("*.ipynb")]
    front = (site / "index.html").read_text()
    assert notebooks
    assert not [name for name in notebooks if f'href="{name}.html"' not in front]
