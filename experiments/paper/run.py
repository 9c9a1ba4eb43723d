"""Compute the figures and numbers of the paper.

    python experiments/paper/run.py [--out FOLDER] [--json FILE] [--only NAME]

Writes images, tables, and a page that compares the numbers. Figures 1, 5 and 8 of the paper are a sketch, a photograph
and a design, and are left out.
"""

import argparse
import dataclasses
import json
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import common  # noqa: E402
import damped_map  # noqa: E402
import figure_2  # noqa: E402
import figure_3  # noqa: E402
import figure_4  # noqa: E402
import figure_6  # noqa: E402
import figure_7  # noqa: E402
import figure_9  # noqa: E402
import page  # noqa: E402
import releases  # noqa: E402

STUDIES = {
    module.__name__: module.study
    for module in (figure_2, figure_3, figure_4, figure_6, figure_7, figure_9, releases, damped_map)
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("paper"), help="folder for images, tables and paper.md")
    parser.add_argument("--json", type=Path, help="write all numbers here")
    parser.add_argument("--only", default="", help="part of the names of the studies to run")
    options = parser.parse_args()
    chosen = {name: study for name, study in STUDIES.items() if options.only in name}
    if not chosen:
        parser.error(f"No study is called {options.only!r}. Choose from {', '.join(STUDIES)}.")
    options.out.mkdir(parents=True, exist_ok=True)
    studies = {name: study() for name, study in chosen.items()}
    for name, study in studies.items():
        common.write(study, name, options.out)
        print(page.table(study), end="\n\n")
    (options.out / "paper.md").write_text(page.markdown(studies), encoding="utf-8")
    if options.json:
        found = {name: [dataclasses.asdict(number) for number in study.numbers] for name, study in studies.items()}
        options.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
