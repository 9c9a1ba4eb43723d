"""Read some three hundred malicious files and print each outcome.

Usage: `python experiments/files/hostile.py`, optionally with names of kinds (`bombs`).

Each file must be read, or refused by the expected sentence, within 5 s and 1 GB. No file may execute code or write to
another place. The script checks this by listing its working folder.
"""

import os
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from experiments.files.hostile_archives import ARCHIVES  # noqa: E402
from experiments.files.hostile_formats import FORMAT_BOMBS, FORMATS  # noqa: E402
from experiments.files.hostile_texts import FITS, NO_FILES, RIGS, TABLES, Hostile  # noqa: E402
from experiments.files.hostile_trees import BOMBS, HDF5, MATLAB  # noqa: E402
from experiments.files.outcome import Outcome, attempt  # noqa: E402

FILES: dict[str, dict[str, Hostile]] = {
    "tables": TABLES,
    "no files": NO_FILES,
    "archives": ARCHIVES,
    "HDF5": HDF5,
    "MATLAB": MATLAB,
    "formats": FORMATS,
    "rigs": RIGS,
    "fits": FITS,
    "bombs": {**BOMBS, **FORMAT_BOMBS},
}


def verdict(folder: Path, name: str, hostile: Hostile) -> tuple[str, str]:
    """Read a file and compare the outcome with the expected one.

    Returns the outcome and the difference. The difference is empty if the outcome is as expected.
    """
    build, expected = hostile
    path = folder / name
    build(path)
    before = sorted(os.listdir(folder))
    outcome = attempt(path)
    if sorted(os.listdir(folder)) != before or (folder / "PWNED").exists():
        return outcome.end, "something was written"
    if not outcome.sound:
        return outcome.end, f"{outcome.seconds:.1f} s, {outcome.gigabytes:.2f} GB: {outcome.words}"
    if not _as_expected(outcome, expected):
        return outcome.end, f"expected {expected!r}, got {outcome.words!r}"
    return outcome.end, ""


def _as_expected(outcome: Outcome, expected: str) -> bool:
    return (outcome.end == "read") == (not expected) and re.search(expected, outcome.words) is not None


def main() -> int:
    chosen = {kind: FILES[kind] for kind in sys.argv[1:] or FILES}
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for kind, files in chosen.items():
            ends: Counter[str] = Counter()
            for name, hostile in files.items():
                end, difference = verdict(Path(folder), name, hostile)
                ends[end] += 1
                if difference:
                    wrong += 1
                    print(f"  {name}: {end}, {difference[:300]}")
            print(
                f"{kind:10} {len(files):4} files: {', '.join(f'{end} {count}' for end, count in sorted(ends.items()))}"
            )
        os.chdir(ROOT)
    print(f"{sum(map(len, chosen.values()))} files, {wrong} not as expected")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
