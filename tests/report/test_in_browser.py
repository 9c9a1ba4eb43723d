"""Pages in a browser: sorting, filtering, opening runs, and hostile texts."""

import json

import numpy as np
import pandas as pd
import pytest

import fricjax as fj
from tests.report.archives import archive
from tests.report.browser import chromium, press

pytestmark = pytest.mark.slow

# Names of files or columns, or texts, that try to run a script in the page.
HOSTILE = (
    "<img src=x onerror='window.hacked=1'>",
    "</script><script>window.hacked=1</script>",
    '"><svg onload="window.hacked=1">',
    "javascript:window.hacked=1",
    "<!--<script>window.hacked=1",
    "${window.hacked=1}`",
)


@pytest.fixture(scope="module")
def frame():
    table = archive(250)
    for i, text in enumerate(HOSTILE):
        table.loc[[i, i + 20], ["file", "outcome", "warnings", "rig"]] = text
        table.loc[i, "status"] = "rejected"
        table[f"{text}"] = text
    return table


@pytest.fixture(scope="module")
def folder(frame, tmp_path_factory):
    """Folder with a page of an archive and one of a fit."""
    made = tmp_path_factory.mktemp("pages")
    fj.report.save(frame, made / "archive.html", title=HOSTILE[1])
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    runs = [fj.synthetic_run(machine, x0, rate=2e3, duration=0.6, noise=1e-9, seed=0) for x0 in (2e-3, 1.7e-3)]
    free = ["mu", "damping", "stiffness"]
    fj.report.save(fj.fit(runs[0], machine, free), made / "fit.html")
    fj.report.save(fj.fit(runs, machine, free), made / "joint.html")
    return made


@pytest.fixture(scope="module")
def browser():
    with chromium() as driver:
        yield driver


@pytest.fixture
def page(browser, folder):
    """Function that opens a page and returns the driver."""

    def opened(name="archive.html"):
        browser.get("about:blank")
        browser.get((folder / name).as_uri())
        return browser

    yield opened
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    assert browser.execute_script("return window.hacked") is None


def texts(driver, selector):
    script = "return [...document.querySelectorAll(arguments[0])].map((each) => each.textContent)"
    return driver.execute_script(script, selector)


def head(driver, name):
    script = (
        "return [...document.querySelectorAll('.runs th button')].find((b) => b.textContent.startsWith(arguments[0]))"
    )
    return driver.execute_script(script, name)


def cells(driver, name):
    """Texts of a column of the table of runs."""
    script = """const heads = [...document.querySelectorAll('.runs thead th')].map((each) => each.textContent);
        const at = heads.findIndex((each) => each.startsWith(arguments[0]));
        return [...document.querySelectorAll('.runs tbody tr')].map((row) => row.children[at].textContent);"""
    return driver.execute_script(script, name)


def count_of(driver):
    return driver.execute_script("return document.querySelector('[role=status]').textContent")


def enter(driver, selector, value):
    script = """const box = document.querySelector(arguments[0]); box.value = arguments[1];
        box.dispatchEvent(new Event('input')); box.dispatchEvent(new Event('change'));"""
    driver.execute_script(script, selector, value)


def test_a_head_sorts_by_numbers_and_the_missing_come_last(page, frame):
    driver = page()
    for name, up in (("mu", True), ("mu", False), ("amplitude", True)):
        head(driver, name).click()
        order = frame[name].sort_values(ascending=up, kind="stable", na_position="last").index[:100]
        assert cells(driver, "run") == frame["file"][order].tolist()
        sort = driver.execute_script("return document.querySelectorAll('.runs [aria-sort]').length")
        assert sort == 1
        parent = driver.execute_script(
            "return arguments[0].parentElement.getAttribute('aria-sort')", head(driver, name)
        )
        assert parent == ("ascending" if up else "descending")


def test_filters_leave_what_pandas_leaves(page, frame):
    driver = page()
    assert count_of(driver) == "250 of 250 runs shown."
    enter(driver, "#find", "00044 CSV")
    assert count_of(driver) == "1 of 250 runs shown."
    enter(driver, "#find", "lubricant-that-is-not-there")
    assert count_of(driver) == "0 of 250 runs shown." and cells(driver, "run") == []
    enter(driver, "#find", "")
    driver.execute_script("document.querySelector('input[value=ok]').click()")
    assert count_of(driver) == f"{(frame['status'] != 'ok').sum()} of 250 runs shown."
    driver.execute_script("document.querySelector('input[value=ok]').click()")
    enter(driver, "#range", "mu")
    enter(driver, "[aria-label^=Lowest]", "0.0199")
    enter(driver, "[aria-label^=Highest]", "0.0201")
    assert count_of(driver) == f"{frame['mu'].between(0.0199, 0.0201).sum()} of 250 runs shown."


def test_a_reason_shows_its_runs(page, frame):
    driver = page()
    reasons = texts(driver, "section[aria-labelledby=reasons] tbody th")
    row = reasons.index("The record has … half-cycles, too few to be fitted.")
    shown = frame["outcome"].str.contains("half-cycles, too few").sum()
    assert texts(driver, "section[aria-labelledby=reasons] tbody td:nth-child(3)")[row] == str(shown)
    driver.execute_script(
        "document.querySelectorAll('section[aria-labelledby=reasons] button')[arguments[0]].click()", row
    )
    assert count_of(driver).startswith(f"{shown} of 250 runs shown with the reason")
    assert set(cells(driver, "status")) == {"× rejected"}


def test_the_table_has_pages(page, frame):
    driver = page()
    assert len(cells(driver, "run")) == 100
    buttons = {text: i for i, text in enumerate(texts(driver, "nav[aria-label^=Pages] button"))}
    driver.execute_script(
        "document.querySelectorAll('nav[aria-label^=Pages] button')[arguments[0]].click()", buttons["Last"]
    )
    assert cells(driver, "run") == frame["file"][200:].tolist()
    assert (
        driver.execute_script("return document.querySelector('.runs tbody tr').getAttribute('aria-rowindex')") == "202"
    )


def test_a_run_opens_by_its_link_and_its_address(page, folder, frame):
    driver = page()
    driver.execute_script("document.getElementById('row-30').focus()")
    press(driver, "\ue007")  # Enter
    driver.execute_async_script("setTimeout(arguments[0], 50)")
    assert texts(driver, "article h2") == [frame["file"][30]]
    assert driver.execute_script("return document.activeElement.id") == "name"
    assert frame["file"][30] in driver.title
    assert texts(driver, "article figure h3") == [
        "Displacement",
        "Residuals",
        "Phase plane",
        "Friction of the half-cycles",
    ]
    mu = driver.execute_script("return document.querySelector('article tbody td').textContent")
    assert mu == fj.show.uncertain(frame["mu"][30], frame["mu_combined_std"][30])
    address = driver.current_url
    driver.back()
    assert texts(driver, "article h2") == []
    assert driver.execute_script("return document.activeElement.id") == "row-30"
    driver.get("about:blank")
    driver.get(address)
    assert texts(driver, "article h2") == [frame["file"][30]]


def test_curves_in_the_browser_are_those_of_the_table(page, frame):
    driver = page()
    row = 210  # in the second block
    decoded = driver.execute_script(
        "const c = curvesOf(arguments[0]); return Object.fromEntries("
        "Object.entries(c).map(([k, v]) => [k, Array.from(v)]))",
        row,
    )
    for name, key, unit in (("t", "sketch_t", 1.0), ("x", "sketch_x", 1e3), ("residual", "sketch_residual", 1e9)):
        expected = unit * np.asarray(frame[key][row], float)
        np.testing.assert_allclose(decoded[name], expected, atol=np.ptp(expected) / 6e4)
    np.testing.assert_allclose(decoded["friction"], frame["mu"][row], rtol=1e-3)
    assert driver.execute_script("return curvesOf(arguments[0])", int(frame["mu"].isna().argmax())) is None


def test_arrow_keys_go_from_run_to_run_of_a_chart(page, frame):
    driver = page()
    driver.execute_script("document.querySelector('svg.chart').focus()")
    press(driver, "\ue014", "\ue014")  # to the right, twice
    second = frame["file"][np.flatnonzero(frame["mu"].notna())[1]]
    text = driver.execute_script("return document.querySelector('svg.chart').getAttribute('aria-valuetext')")
    assert text.startswith(f"{second}: mu 0.0")
    press(driver, "\ue007")
    driver.execute_async_script("setTimeout(arguments[0], 50)")
    assert texts(driver, "article h2") == [second]


def test_no_text_of_a_file_runs(page, frame):
    driver = page()
    shown = cells(driver, "run")
    assert shown[: len(HOSTILE)] == list(HOSTILE)
    assert driver.execute_script("return document.title") == HOSTILE[1]
    for row in range(len(HOSTILE)):
        driver.execute_script("location.hash = addressOf(arguments[0])", row)
        driver.execute_async_script("setTimeout(arguments[0], 50)")
        assert texts(driver, "article h2") == [HOSTILE[row]]
    made = driver.execute_script("return document.querySelectorAll('img, iframe, object, article script').length")
    assert made == 0


def test_the_policy_stops_what_a_page_would_let_in(browser, page):
    driver = page()
    script = """const s = document.createElement('script');
        try { s.textContent = 'window.hacked = 2'; document.body.append(s); return 'made'; }
        catch (error) { return error.name; }"""
    assert driver.execute_script(script) == "TypeError"
    with pytest.raises(Exception, match="TrustedHTML"):
        driver.execute_script("document.body.innerHTML = '<b>x</b>'")
    assert driver.execute_script("return fetch('https://example.org').then(() => 'sent', () => 'refused')") == "refused"
    browser.get_log("browser")  # discard the expected refusals


@pytest.mark.parametrize("name", ["fit.html", "joint.html"])
def test_a_fit_shows_its_report_and_pictures(page, name):
    driver = page(name)
    assert "mu" in texts(driver, "tbody th")
    if name == "joint.html":
        assert len(cells(driver, "run")) == 2
        driver.execute_script("location.hash = addressOf(1)")
        driver.execute_async_script("setTimeout(arguments[0], 50)")
    pictures = texts(driver, "figure h3")
    assert [each for each in pictures if " against " not in each] == [
        *("Displacement", "Residuals", "Phase plane", "Friction of the half-cycles"),
    ]


def test_a_table_without_numbers_is_a_page_too(browser, tmp_path):
    table = pd.DataFrame({"file": ["a", "b"], "status": ["failed", "rejected"], "outcome": ["x", "y"]})
    browser.get(fj.report.save(table, tmp_path / "bare.html").as_uri())
    assert count_of(browser) == "2 of 2 runs shown."
    browser.execute_script("location.hash = addressOf(0)")
    browser.execute_async_script("setTimeout(arguments[0], 50)")
    assert texts(browser, "article figure") == []
    assert json.dumps(browser.get_log("browser")) == "[]"
