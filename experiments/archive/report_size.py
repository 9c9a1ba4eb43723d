"""Measure size and speed of the HTML page of an archive.

    python experiments/archive/report_size.py [--runs 20000]

Prints the time to make the page, its size, and the time until a browser shows its first row. The table comes from a
closed form (tests/report/archives.py), so that only the page is measured. The browser is Debian's Chromium in headless
mode. Without it only the page is measured.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fricjax import report
from tests.report.archives import archive
from tests.report.browser import chromium

# Milliseconds from the request to the end of the page's scripts, and the number of table rows at that time.
_LOADED = "return performance.getEntriesByType('navigation')[0].loadEventEnd"
_ROWS = "return document.querySelectorAll('table.runs tbody tr').length"
# Actions of a reader. Each is timed until the page is ready for the next one.
_ACTIONS = {
    "sorted by mu": "[...document.querySelectorAll('.runs th button')].find((b) => b.textContent === 'mu').click()",
    "filtered by text": "const box = document.getElementById('find'); box.value = '00123';"
    "box.dispatchEvent(new Event('input'))",
    # The page follows its address with a delay. Calling route() avoids the delay.
    "one run opened": "location.hash = addressOf(123); route(); document.body.offsetHeight",
}


def measure(runs: int, path: Path) -> None:
    """Print the figures of a page with a given number of runs."""
    table = archive(runs)
    started, busy = time.perf_counter(), time.process_time()
    report.save(table, path, overwrite=True)
    took, busy = time.perf_counter() - started, time.process_time() - busy
    print(f"{runs} runs: made in {took:.1f} s ({busy:.1f} s of one core), {path.stat().st_size / 1e6:.1f} MB")
    with chromium() as browser:
        started = time.perf_counter()
        browser.get(path.as_uri())
        waited = time.perf_counter() - started
        loaded, rows = browser.execute_script(_LOADED), browser.execute_script(_ROWS)
        print(f"first of {rows} rows shown after {loaded / 1e3:.2f} s ({waited:.2f} s with the driver)")
        for name, script in _ACTIONS.items():
            took = browser.execute_script(f"const t = performance.now(); {script}; return performance.now() - t")
            print(f"{name}: {took:.0f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20_000)
    with tempfile.TemporaryDirectory() as folder:
        measure(parser.parse_args().runs, Path(folder) / "archive.html")


if __name__ == "__main__":
    main()
