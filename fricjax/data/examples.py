"""The example that comes with the package: a synthetic interferometer run and the file of its rig.

A mass of 0.41 kg on leaf springs (12.6 Hz) under a load of 9.66 N, with mu = 0.02, is kept at 2 mm by a magnet,
released, and comes to rest after some thirteen half-cycles; 5 kHz, 5 nm of noise. `meta["coefficients"]` of the record
holds the truth.
"""

from pathlib import Path
from typing import NamedTuple

_FOLDER = Path(__file__).parent / "example"


class ExamplePaths(NamedTuple):
    """Where the example lies: `run` for `fricjax.read`, `rig` for `fricjax.Rig.from_toml`."""

    run: Path
    rig: Path


def example_paths() -> ExamplePaths:
    """Paths of the example's record and of its rig file.

    Examples:
        >>> import fricjax as fj
        >>> run, rig = fj.data.example_paths()
        >>> run.name, rig.name, fj.read(run).trace.n
        ('run.csv', 'rig.toml', 4000)
    """
    return ExamplePaths(_FOLDER / "run.csv", _FOLDER / "rig.toml")
