"""How long the page of an archive takes to be made, how large it is, and when a browser shows its first row.

    python experiments/archive/report_size.py [--runs 20000]

The table is computed in closed form (tests/report/archives.py), so that only the page is measured. The browser is
Debian's Chromium without a screen; where it is not installed the page alone is measured.
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

# Milliseconds from the request to the end of the page's scripts, and the number of rows in its table by then.
_LOADED = "return performance.getEntriesByType('navigation')[0].loadEventEnd"
_ROWS = "return document.querySelectorAll('table.runs tbody tr').length"
# What a reader does, with the time that the page needs until it is ready for the next thing.
_ACTIONS = {
    "sorted by mu": "[...document.querySelectorAll('.runs th button')].find((b) => b.textContent === 'mu').click()",
    "filtered by text": "const box = document.getElementById('find'); box.value = '00123';"
    "box.dispatchEvent(new Event('input'))",
    # The page follows its address later; asked at once, it does now.
    "one run opened": "location.hash = addressOf(123); route(); document.body.offsetHeight",
}


def measure(runs: int, path: Path) -> None:
    """Prints the figures of a page of so many runs."""
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
