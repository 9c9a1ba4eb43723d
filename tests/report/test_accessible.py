"""Accessibility of the page: names for screen readers, contrast, Tab order, print."""

import base64
import itertools

import pytest

import fricjax as fj
from tests.report.archives import archive
from tests.report.browser import chromium, press

pytestmark = pytest.mark.slow

# Roles that need a name.
NAMED = {
    *("button", "checkbox", "combobox", "image", "img", "link", "navigation", "region", "search", "searchbox"),
    *("slider", "spinbutton", "table", "textbox", "columnheader"),
}
# Minimal contrast of text and of graphics or controls: WCAG 2.2, 1.4.3 and 1.4.11.
TEXT, GRAPHIC = 4.5, 3.0
CONTRASTS = """
const channels = (colour) => colour.match(/[\\d.]+/g).map(Number);
const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
const light = (colour) => channels(colour).slice(0, 3).map((c) => linear(c / 255))
  .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
const behind = (each) => {
  for (; each; each = each.parentElement) {
    const { backgroundColor } = getComputedStyle(each);
    if (channels(backgroundColor)[3] !== 0) return backgroundColor;
  }
};
const contrast = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
const seen = [];
for (const each of document.querySelectorAll('body *')) {
  if (!each.checkVisibility() || ['SCRIPT', 'NOSCRIPT'].includes(each.tagName)) continue;
  const style = getComputedStyle(each);
  const name = each.className.baseVal ?? each.className;
  const drawn = each instanceof SVGElement;
  const words = [...each.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  if (words) seen.push(['text', name, each.tagName, contrast(drawn ? style.fill : style.color, behind(each))]);
  else if (drawn && each.getAttribute('d')) seen.push(['graphic', name, 'path', contrast(style.stroke, behind(each))]);
}
return seen;
"""
# Scripts for the levels of headings, tables without heads or captions, the focused element, and text sizes.
LEVELS = """return [...document.querySelectorAll('h1, h2, h3')].filter((each) => each.checkVisibility())
    .map((each) => Number(each.tagName[1]))"""
BARE = """return document.querySelectorAll('th:not([scope]), table:not(:has(caption)), '
    + '[tabindex]:not([tabindex="0"], [tabindex="-1"])').length"""
FOCUSED = """const each = document.activeElement;
    return [each.id, each.textContent, getComputedStyle(each).outlineStyle,
            [...document.querySelectorAll('*')].indexOf(each)]"""
SIZES = """return [...document.querySelectorAll('svg text')].filter((each) => each.checkVisibility())
    .map((each) => 13 * each.ownerSVGElement.getBoundingClientRect().width / 720)"""
CONTROLS = """return [...document.querySelectorAll('input, select, .controls, .skip')]
    .filter((each) => each.checkVisibility()).length"""


@pytest.fixture(scope="module")
def table():
    frame = archive(120)
    frame.loc[7, "mu"] = 0.0225
    return frame


@pytest.fixture(scope="module")
def address(table, tmp_path_factory):
    return fj.report.save(table, tmp_path_factory.mktemp("page") / "archive.html").as_uri()


def views(table, address):
    """Return the page of all runs and that of one run."""
    yield address
    yield f"{address}#run={table['key'][table['mu'].first_valid_index()][:16]}"


def opened(driver, address):
    driver.get("about:blank")
    driver.get(address)


def test_everything_has_a_name_that_can_be_said(table, address):
    with chromium() as driver:
        for view in views(table, address):
            opened(driver, view)
            nodes = driver.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
            said = [
                (node["role"]["value"], node.get("name", {}).get("value", ""))
                for node in nodes
                if not node["ignored"] and node["role"]["value"] in NAMED
            ]
            assert len(said) > 10
            assert [each for each in said if not each[1].strip()] == []
            ids = driver.execute_script("return [...document.querySelectorAll('[id]')].map((each) => each.id)")
            assert len(ids) == len(set(ids))
            levels = driver.execute_script(LEVELS)
            assert levels[0] == 1 and all(b - a <= 1 for a, b in itertools.pairwise(levels))
            assert driver.execute_script(BARE) == 0
            assert driver.execute_script("return document.documentElement.lang") == "en"


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_everything_can_be_told_from_what_is_behind_it(table, address, dark):
    with chromium(dark=dark) as driver:
        for view in views(table, address):
            opened(driver, view)
            seen = driver.execute_script(CONTRASTS)
            faint = {
                (kind, name, tag, round(ratio, 2))
                for kind, name, tag, ratio in seen
                # A dark line lies on the pale broad line of the record. The bars only repeat numbers of the table.
                if ratio < (TEXT if kind == "text" else GRAPHIC) and name not in ("measured", "bars")
            }
            assert faint == set()
            assert {"text", "graphic"} == {each[0] for each in seen}
        ground = driver.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, ground[4:-1].split(","))) < 200) == dark


def test_the_tab_key_goes_through_the_page_in_its_order(address):
    with chromium() as driver:
        opened(driver, address)
        stops = []
        for _ in range(30):
            press(driver, "\ue004")
            stops.append(driver.execute_script(FOCUSED))
    assert stops[0][1] == "Skip to the content"
    places = [place for *_, place in stops]
    assert places == sorted(places)
    assert [stop for stop in stops if stop[2] == "none"] == []
    assert {"coefficient", "find", "range"} <= {name for name, *_ in stops}


@pytest.mark.parametrize("width", [800, 1280])
def test_nothing_but_the_table_is_wider_than_the_window(table, address, width):
    with chromium(width=width) as driver:
        for view in views(table, address):
            opened(driver, view)
            assert driver.execute_script("return document.documentElement.scrollWidth <= innerWidth")
            sizes = driver.execute_script(SIZES)
            assert min(sizes) > 10.0


def test_paper_has_no_controls_and_dark_ink(table, address):
    with chromium(dark=True) as driver:
        for view in views(table, address):
            opened(driver, view)
            printed = driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": False})
            assert base64.b64decode(printed["data"]).startswith(b"%PDF")
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
            assert driver.execute_script(CONTROLS) == 0
            assert driver.execute_script("return getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
