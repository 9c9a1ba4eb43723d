"""Compare the engines of fricjax with five peers.

    python experiments/benchmarks/run.py [--quick] [--only NAME] [--json FILE] [--plot FILE] [--repeats N] [--warm]

Prints ratios of times, model solves, optima, numerical errors, peak memory, and cold and warm times. Needs the extra
"peers" (numba, casadi). A full run takes about an hour on two cores, mostly for the peers' cold fits of archives. The
results of each workload also go to standard error as soon as they are measured.
"""

import argparse
import dataclasses
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

WORKLOADS = ("rolling", "rolling-exact", "rolling-lugre", "archive (Coulomb)", "archive (Tanh)", "map", "sliding")
WORKLOADS += ("long", "errors")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="short records, few runs and repeats, no cold times")
    parser.add_argument("--only", default="", help="part of the names of the workloads to run")
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--plot", type=Path, help="write a plot of the ratios here")
    parser.add_argument("--repeats", type=int, help="rounds of timing")
    parser.add_argument("--warm", action="store_true", help="no cold times and no memory, which need fresh processes")
    options = parser.parse_args()
    if not any(options.only in name for name in WORKLOADS):
        parser.error(f"No workload is called {options.only!r}. Choose from {', '.join(WORKLOADS)}.")
    found = measured(options)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1))


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Run, print the tables, and return all figures as plain data."""
    # Worker processes import this file, so heavy imports come only here.
    import errors
    import report
    from comparison import QUICK, TARGETS, Scale, compare, long

    scale = QUICK if options.quick else Scale()
    if options.repeats:
        scale = dataclasses.replace(scale, repeats=options.repeats)
    scale = dataclasses.replace(scale, fresh=scale.fresh and not options.warm)
    rows, longs, numerical = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for workload in WORKLOADS[:-2]:
            if options.only in workload:
                print(f"{workload} ...", file=sys.stderr, flush=True)
                made = compare(workload, scale, Path(folder))
                print(report.ratios(made), file=sys.stderr, flush=True)
                rows += made
        if options.only in "long":
            longs = long(scale, Path(folder))
    if options.only in "errors":
        numerical = list(errors.table(scale.duration))
    for table in (report.ratios(rows), report.long(longs), report.errors(numerical)):
        if table.rows:
            print(table, end="\n\n")
    if options.plot and rows:
        report.plot(rows, options.plot)
    return {
        "rows": [dataclasses.asdict(row) for row in rows],
        "long": [dataclasses.asdict(row) for row in longs],
        "errors_nm": [dict(zip(("workload", "method", "error"), row, strict=True)) for row in numerical],
        "targets": [{"workload": w, "peer": p, "at_least": least} for (w, p), least in TARGETS.items()],
    }


if __name__ == "__main__":
    main()
