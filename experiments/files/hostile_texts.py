"""Malicious text files: unit expressions, rigs, saved fits and special files."""

import copy
import functools
import json
import os
import socket
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from experiments.files.seeds import RIG, fit

type Hostile = tuple[Callable[[Path], object], str]
"""Writer of the file, and regular expression of the expected error; empty if the file can be read."""

UNKNOWN = "is not a known unit|does not fit|only a scale makes"
UNITS = [
    "9**9**9**9**9 m", "m**99", "m^9^9^9", "m**-", "((((m))))", "__import__('os').system('touch PWNED')", "m" * 5000,
    "m/0", "m^0", "1e999 m", "lambda: m", "\x1b[31mm", "counts", "m " * 22, "/m", "m/",
    "m^9 m^9 m^9", "kg", "µ", "()", "²", "m.__class__", "{m}", "%s%s%n", "0x10 m", "fm^9 fm^9 fm^9 fm^9",
]  # fmt: skip


def _table(unit: str) -> Callable[[Path], object]:
    rows = "".join(f"{i / 1000},{1e-3 * (-1) ** i}\n" for i in range(20))
    return lambda path: path.write_text(f"t [s],x [{unit}]\n{rows}", encoding="utf-8")


def _rig(*lines: str, without: str = "") -> Callable[[Path], object]:
    kept = [line for line in RIG.splitlines() if not (without and line.startswith(without))]
    return lambda path: path.write_text("\n".join([*kept, *lines]), encoding="utf-8")


def _mass(value: str) -> Callable[[Path], object]:
    return _rig(f"mass = {value}", without="mass")


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


_NUMBER = "must be (a finite number|a number|finite|one number)|is no (quantity|number)"
RIGS: dict[str, Hostile] = {
    "bom.toml": (lambda path: path.write_text(RIG, encoding="utf-8-sig"), ""),
    "empty.toml": (lambda path: path.write_text(""), "'mass' is missing"),
    "utf16.toml": (lambda path: path.write_text(RIG, encoding="utf-16"), "no valid TOML"),
    "binary.toml": (lambda path: path.write_bytes(bytes(range(256)) * 4), "no valid TOML"),
    "deep.toml": (lambda path: path.write_text("mass = " + "\n[" * 5000), "nested too deeply|no valid TOML"),
    "deep_closed.toml": (_mass("[" + "\n[" * 200 + "\n]" * 200 + "]"), _NUMBER),
    "digits.toml": (_mass("9" * 900 + "\nk3 = " + "9" * 900), _NUMBER),
    "many_digits.toml": (lambda path: path.write_text("mass = " + "9" * 5000), "has more than 1000 characters"),
    "hex.toml": (_mass("0x" + "f" * 900), _NUMBER),
    "overflow.toml": (_mass("1e400"), _NUMBER),
    "nan.toml": (_mass("nan"), _NUMBER),
    "list.toml": (_mass("[1, 2]"), _NUMBER),
    "ragged.toml": (_mass("[[1], [1, 2]]"), _NUMBER),
    "true.toml": (_mass("true"), _NUMBER),
    "date.toml": (_mass("1979-05-27"), _NUMBER),
    "table.toml": (_mass("{ std = 1 }"), "has no value"),
    "value_text.toml": (_mass('{ value = "1" }'), _NUMBER),
    "value_huge.toml": (_mass("{ value = 1" + "0" * 500 + " }"), _NUMBER),
    "std_list.toml": (_mass("{ value = 1, std = [1] }"), _NUMBER),
    "std_negative.toml": (_mass("{ value = 1, std = -1 }"), "must not be negative"),
    "unit_list.toml": (_mass("{ value = 1, unit = [1] }"), "unit of mass must be a text"),
    "unit_bomb.toml": (_mass('{ value = 1, unit = "9**9**9**9**9 kg" }'), "unknown unit"),
    "unit_bomb_text.toml": (_mass('"1 9**9**9**9**9 kg"'), "no quantity"),
    "unit_code.toml": (_mass("\"1 __import__('os')\""), "unknown unit"),
    "unit_wrong.toml": (_mass('"1 m"'), "does not fit mass"),
    "blanks.toml": (_mass('"1 a' + " " * 900 + 'b"'), "no quantity"),
    "zero.toml": (_mass("0"), "must be a positive number"),
    "tiny.toml": (_mass("1e-320"), "must be a positive number"),
    "huge.toml": (_mass("1e200"), "no number of a rig"),
    "restoring_list.toml": (_rig("restoring = [[1]]", without="restoring"), "restoring must be"),
    "key_long.toml": (_rig("k" * 900 + " = 1"), "there is no key"),
    "key_escape.toml": (_rig('"\\u001b[31m" = 1'), "there is no key"),
    "dotted.toml": (lambda path: path.write_text("a" + ".a" * 40_000 + " = 1"), "more than 1000 characters"),
    "twice.toml": (_rig("mass = 1"), "no valid TOML"),
    "large.toml": (lambda path: path.write_text("# " + "x" * 60 + "\n" * 200_000), "at most"),
    "pipe.toml": (os.mkfifo, "is a device, a pipe or a socket"),
    "folder.toml": (Path.mkdir, "is a folder"),
    "device.toml": (lambda path: path.symlink_to("/dev/zero"), "is a device, a pipe or a socket"),
}


@functools.cache
def _document() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        return json.loads(fit().save(Path(folder) / "fit.json").read_text())


def _edited(place: str, *value: Any) -> Callable[[Path], object]:
    """Write a saved fit with one entry replaced or removed."""

    def write(path: Path) -> None:
        document = copy.deepcopy(_document())
        node: Any = document
        *folders, last = [int(part) if part.isdigit() else part for part in place.split(".")]
        for part in folders:
            node = node[part]
        if value:
            node[last] = value[0]
        else:
            del node[last]
        path.write_text(json.dumps(document))

    return write


EDITS: list[tuple[str, tuple[Any, ...], str]] = [
    ("schema", ("fricjax.fit/99",), "no fit of schema"),
    ("schema", ([["x"]],), "no fit of schema"),
    ("values", ([1],), "'values' must be an object"),
    ("values.mu", ("text",), "'values.mu' must be a number"),
    ("values.mu", ([1.0],), "'values.mu' must be a number"),
    ("values.mu", (10**400,), "'values.mu' must be a number"),
    ("values.mu", (True,), "'values.mu' must be a number"),
    ("values.mu", (), "'values' has no entry 'mu'"),
    ("values.more", (1.0,), "'units' has no entry 'more'"),
    ("std_errors.mu", (-1.0,), "is negative"),
    ("std_errors.mu", (None,), "'std_errors.mu' must be a number"),
    *(
        (f"{kind}std_errors.more", (1.0,), "'more', which is not among the names")
        for kind in ("", "white_", "combined_")
    ),
    ("names", ("mu",), "'names' must be a list"),
    ("names", ([1, 2],), r"'names\[0\]' must be a text"),
    ("names", (["mu"],), "shape"),
    ("names", ({"mu": 1},), "'names' must be a list"),
    ("covariance", ([[1.0]],), "shape"),
    ("covariance", ([[1.0, 2.0], [3.0]],), "rows of one length"),
    ("covariance", ([[1.0, "a"], [1.0, 1.0]],), "must be a number"),
    ("covariance", (5,), "'covariance' must be a list"),
    ("flags.mu", ("text",), "'flags.mu' must be a list"),
    ("flags.mu", ([[1]],), "must be a text"),
    ("intervals.mu", ([1.0],), "must be a list of 2"),
    ("units.mu", (3,), "must be a text"),
    ("converged", ("yes",), "must be true or false"),
    ("dof", (0,), "'dof' must be positive"),
    ("dof", (1.5,), "'dof' must be a whole number"),
    ("dof", (10**30,), "'dof' must be a whole number"),
    ("status", (None,), "'status' must be a text"),
    ("quantity", ("furlong",), "'quantity'"),
    ("kinematics.dead_band", ({"value": 1.0},), "has no entry 'std'"),
    ("kinematics.dead_band.more", (1,), "has an entry 'more'"),
    ("kinematics", ([],), "'kinematics' must be an object"),
    ("contributions.mu", ([1],), "must be an object"),
    ("noises", ([],), "'noises' has 0 entries for 1 runs"),
    ("noises.0.lines", ([5],), "must be an object of the type Line"),
    ("whiteness.white", (1,), "must be true or false"),
    ("margins.0", ([1, 2],), "must be an object of the type Margin"),
    ("half_cycles", (["a"],), "must be a whole number"),
    ("oscillator", ({"type": "Mine"},), "which fricjax does not know"),
    ("oscillator", ({"type": "Coulomb", "mu": 1.0, "mu_s": None},), "'oscillator.type' must be a Oscillator"),
    ("oscillator", ([1],), "'oscillator' must be an object"),
    ("oscillator.mass", (-1.0,), "is no Oscillator"),
    ("oscillator.friction.mu", ("text",), "must be a number"),
    ("oscillator.friction.type", (["x"],), "does not know"),
    ("oscillator.friction.type", ("os.system",), "does not know"),
    ("oscillator.friction", (None,), "must be an object"),
    ("samples.engine_used", ({"type": "Linear"},), "'engine_used.type' must be a Engine"),
    ("samples.engine_used.max_half_cycles", ("9" * 9999,), "must be a whole number"),
    ("samples", ([],), "does not hold residuals"),
    ("samples.residuals", ([1.0],), "differ in number"),
    ("samples.residuals", (["text"],), "must be a number|must be a list"),
    ("samples.times", ([[]],), "differ in number"),
    ("samples.times", ([1.0],), "must be a list of numbers"),
    ("samples.runs", ([],), "entries for 0 runs"),
    ("samples.runs.0.t", ([[1.0]],), "differ in number"),
    ("samples.runs.0.fixed", (["x"],), "must be an object"),
    ("samples.origins", ([1.0, 2.0],), "'origins' has 2 entries"),
    ("chi2", (), "does not hold chi2"),
]

FITS: dict[str, Hostile] = {
    **{f"{i:02}_{place}.json": (_edited(place, *value), words) for i, (place, value, words) in enumerate(EDITS)},
    "deep.json": (lambda path: path.write_text("[" * 100_000), "nested too deeply"),
    "deep_closed.json": (_edited("values.mu", json.loads("[" * 500 + "]" * 500)), "must be a number"),
    "digits.json": (lambda path: path.write_text('{"schema": ' + "9" * 5000 + "}"), "not a JSON file"),
    "utf16.json": (lambda path: path.write_bytes(json.dumps(_document()).encode("utf-16")), ""),
    "binary.json": (lambda path: path.write_bytes(bytes(range(256))), "not a JSON file"),
    "folder.json": (Path.mkdir, "is a folder"),
    "pipe.json": (os.mkfifo, "is a device, a pipe or a socket"),
    "sparse.json": (lambda path: (path.touch(), os.truncate(path, 1 << 40)), "at most 1 GB"),
}

TABLES: dict[str, Hostile] = {f"unit{i:02}.csv": (_table(unit), UNKNOWN) for i, unit in enumerate(UNITS)}
NO_FILES: dict[str, Hostile] = {
    "pipe.csv": (os.mkfifo, "is a device, a pipe or a socket"),
    "pipe.npz": (os.mkfifo, "is a device, a pipe or a socket"),
    "socket.csv": (_socket, "is a device, a pipe or a socket"),
    "device.csv": (lambda path: path.symlink_to("/dev/zero"), "is a device, a pipe or a socket"),
    "folder.csv": (Path.mkdir, "is a folder"),
    "circle.csv": (lambda path: path.symlink_to(path), "There is no file"),
    "nowhere.csv": (lambda path: path.symlink_to("nowhere"), "There is no file"),
    "empty.csv": (Path.touch, "is empty"),
}
