"""Arguments of the wrong kind, which public functions should refuse.

As a program it prints the arguments that are not refused so. It runs without the type checks of the tests, which would
refuse some of them first.
"""

import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np

import fricjax as fj
from fricjax.errors import DataError, UsageError

jax.config.update("jax_enable_x64", True)

RUN, RIG = fj.data.example_paths()
MACHINE = fj.Oscillator(0.41, 2574.0, 0.17, 9.66, fj.friction.Coulomb(0.02))
FREE = ("mu", "damping", "stiffness")
T = np.linspace(0.0, 0.1, 200)
TEXT, NOTHING, COMPLEX, MATRIX, EMPTY, OBJECT = "text", None, 1 + 2j, np.zeros((2, 2)), [], object()
ODD = (NOTHING, COMPLEX, OBJECT)
NUMBERS = (TEXT, *ODD, MATRIX, EMPTY)
OBJECTS = (TEXT, *ODD, 1.0, EMPTY)


def calls() -> Iterator[tuple[Callable[..., Any], dict[str, Any], dict[str, Any]]]:
    """Yield functions, valid arguments, and invalid values of each argument."""
    record = fj.read(RUN)
    rig = fj.Rig.from_toml(RIG)
    motion = fj.simulate(MACHINE, 2e-3, T)
    fit = {"data": record, "oscillator": MACHINE, "free": FREE}
    mappings = dict.fromkeys(("bounds", "priors", "tie", "guess"), (TEXT, 1.0, COMPLEX, [1], OBJECT))
    names = {
        "free": (NOTHING, 1.0, OBJECT, EMPTY, ("mu", "mu"), "moo"),
        "oscillator": OBJECTS,
        "data": (NOTHING, OBJECT),
    }
    pairs = {"x0": [1e-3, 2e-3, 3e-3], "xf": [1e-4, -1e-4, 5e-5]}
    yield fj.simulate, {"oscillator": MACHINE, "x0": 2e-3, "ts": T}, {
        "oscillator": OBJECTS, "x0": NUMBERS, "ts": (TEXT, *ODD, MATRIX, EMPTY, T[::-1]), "v0": NUMBERS,
        "accuracy": (*NUMBERS, -1.0, np.nan), "engine": (*OBJECTS, "exakt"),
    }  # fmt: skip
    yield fj.final_displacement, {"oscillator": MACHINE, "x0": 2e-3}, {"oscillator": OBJECTS, "x0": (TEXT, *ODD)}
    yield fj.energy, {"oscillator": MACHINE, "motion": motion}, {"oscillator": OBJECTS, "motion": OBJECTS}
    yield fj.fit, fit, {
        **names, **mappings, "nuisance": (1.0, COMPLEX, OBJECT, ("x0", "x0"), "y0"), "start": (NOTHING, COMPLEX, EMPTY),
        "noise": (NOTHING, EMPTY, MATRIX, "pink"), "loss": (NOTHING, TEXT, EMPTY), "sigma_mode": (NOTHING, TEXT, EMPTY),
        "rig": (TEXT, 1.0),
    }  # fmt: skip
    yield fj.fit_batch, fit, names
    yield fj.multistart, fit, {**names, "starts": (*NUMBERS, 0, -1, 1.5), "spread": (*NUMBERS, 0.5)}
    compared = {"oscillators": (*OBJECTS, [TEXT]), "free": (1.0, COMPLEX, OBJECT, [1.0])}
    yield fj.compare, {"data": record, "oscillators": [MACHINE], "free": [FREE]}, compared
    estimated = {"x": record.x, "ts": record.t, "oscillator": MACHINE, "names": FREE, "sigma": 5e-9}
    refused = {"x": NUMBERS, "ts": NUMBERS, "sigma": NUMBERS, "oscillator": OBJECTS, "names": (NOTHING, 1.0, EMPTY)}
    yield fj.estimate, estimated, refused
    synthetic = {"oscillator": MACHINE, "x0": 2e-3, "rate": 2e3, "duration": 0.1}
    yield fj.synthetic_run, synthetic, {"oscillator": OBJECTS, "rate": (-1.0, 0.0), "duration": (-1.0,)}
    of_pairs = {"x0": (TEXT, *ODD, MATRIX, EMPTY), "xf": (TEXT, *ODD, MATRIX, EMPTY)}
    yield fj.fit_final_displacements, {**pairs, "oscillator": MACHINE}, {**of_pairs, "oscillator": OBJECTS}
    yield fj.fit_triangle_map, {**pairs, "rig": rig}, {**of_pairs, "rig": OBJECTS}
    yield fj.pairs_of, {"records": [record]}, {"records": (NOTHING, OBJECT, EMPTY)}
    yield fj.read, {"source": RUN}, {
        "source": (NOTHING, OBJECT, EMPTY, 1.0), "unit": (1.0, EMPTY, OBJECT, "parsec"), "column": (1.5, OBJECT),
        "crop": (TEXT, 1.0, EMPTY, (0.0, TEXT)), "repair": (TEXT, 1.0, EMPTY), "rate": (-1.0, 0.0),
    }  # fmt: skip
    yield fj.write, {"record": record, "path": "run.csv"}, {"path": (*ODD, 1.0, "run.doc"), "record": (NOTHING, OBJECT)}
    yield fj.load_fit, {"path": "fit.json"}, {"path": (*ODD, 1.0)}
    yield fj.open_archive, {"path": "store"}, {"path": (*ODD, 1.0)}
    yield fj.data.crop, {"record": record}, {"record": OBJECTS, "start": (TEXT, COMPLEX, MATRIX, EMPTY, OBJECT)}
    yield fj.data.convert_unit, {"record": record, "unit": "um"}, {"record": OBJECTS, "unit": (*ODD, 1.0, EMPTY)}
    yield fj.data.find_slips, {"record": record}, {"record": OBJECTS, "fringe": (TEXT, COMPLEX, EMPTY, -1.0, 0.0)}
    yield fj.data.segment, {"t": T, "x": np.cos(40 * T)}, {"t": NUMBERS, "x": NUMBERS}
    yield (
        fj.sensitivity.fisher,
        {"oscillator": MACHINE, "x0": 1e-3, "names": ["mu"]},
        {"oscillator": OBJECTS, "x0": NUMBERS},
    )


def accepted() -> list[str]:
    """Return the calls that raise nothing or an error of another library."""
    wrong = []
    for function, valid, refused in calls():
        for name, values in refused.items():
            for value in values:
                try:
                    function(**{**valid, name: value})
                    outcome = "accepted"
                except (UsageError, DataError):
                    continue
                except Exception as error:
                    # The functions of the oscillator raise ValueError in their own words.
                    if isinstance(error, ValueError) and "fricjax" in Path(raised_in(error)).parts:
                        continue
                    outcome = repr(error)
                wrong.append(f"{function.__name__}({name}={value!r}): {outcome}")
    return wrong


def raised_in(error: Exception) -> str:
    """Return the file that raised an error."""
    return traceback.extract_tb(error.__traceback__)[-1].filename


if __name__ == "__main__":
    print("\n".join(accepted()))
