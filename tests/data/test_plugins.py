"""Plug-in readers are found by entry points and loaded on demand."""

import sys

import numpy as np
import pytest

from fricjax.data import read
from fricjax.errors import DataError, UsageError

GOOD = """
import numpy
from fricjax.data.readers.assemble import records_of
from fricjax.data.readers.sheet import Column, Sheet

def read_xyz(path, choice, *, skip=0):
    numbers = numpy.loadtxt(path, skiprows=skip)
    sheet = Sheet(
        [Column("t", "ms", key=0), Column("x", "um", key=1), Column("y", "um", key=2)],
        lambda wanted: [numbers[:, column.key] for column in wanted],
    )
    return records_of(path, "xyz", sheet, choice)

nothing = lambda path: None
number = 5
fails = lambda path: 1 / 0
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a function that installs a distribution with entry points, like pip."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(site)

    def install(name, source, **points):
        module = name.replace("-", "_")
        (site / f"{module}.py").write_text(source)
        about = site / f"{module}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = [f"{suffix} = {module}:{target}" for suffix, target in points.items()]
        (about / "entry_points.txt").write_text("\n".join(["[fricjax.readers]", *lines]))
        monkeypatch.delitem(sys.modules, module, raising=False)

    return install


@pytest.fixture
def run(tmp_path):
    t = np.arange(6.0)
    for suffix in ("xyz", "bad", "no", "num", "div", "abc", "csv"):
        np.savetxt(
            tmp_path / f"run.{suffix}", np.stack([t, t**2, t**3], axis=1), delimiter="," if suffix == "csv" else " "
        )
    return lambda suffix: tmp_path / f"run.{suffix}"


def test_a_plug_in_reads_its_suffix_with_all_options(installed, run):
    installed("fricjax-xyz", GOOD, xyz="read_xyz")
    record = read(run("xyz"))
    assert record.t == pytest.approx(1e-3 * np.arange(6)) and record.x == pytest.approx(1e-6 * np.arange(6) ** 2)
    assert read(run("xyz"), column="y", sign=-1).x[1] == -1e-6
    assert len(read(run("xyz"), skip=2)) == 4
    with pytest.raises(UsageError, match=r"skpi= is no option for .xyz files. Did you mean 'skip='"):
        read(run("xyz"), skpi=2)
    with pytest.raises(DataError, match=r"the suffix '.abc', and known are .*, \.xyz\. Export it"):
        read(run("abc"))


def test_a_broken_plug_in_takes_no_other_down(installed, run):
    installed("fricjax-bad", "import no_such_module", bad="read", csv="read", xyz="read")
    installed("fricjax-xyz", GOOD, xyz="read_xyz")
    assert read(run("csv"), column=1, time=0, unit="um").x[2] == pytest.approx(4e-6)
    assert "fricjax_bad" not in sys.modules
    assert read(run("xyz")).x[2] == pytest.approx(4e-6)
    with pytest.raises(
        UsageError, match=r"plug-in for .bad files does not load: fricjax-bad \(ModuleNotFoundError: No mod"
    ):
        read(run("bad"))


def test_what_a_plug_in_does_wrong_is_told_as_its_fault(installed, run):
    installed("fricjax-xyz", GOOD, no="nothing", num="number", div="fails", exit="nowhere")
    with pytest.raises(DataError, match=r"The plug-in fricjax-xyz gave NoneType for run.no, and no record"):
        read(run("no"))
    with pytest.raises(UsageError, match=r"fricjax-xyz \('fricjax_xyz:number' is no function\)"):
        read(run("num"))
    with pytest.raises(DataError, match=r"run.div cannot be read by the plug-in fricjax-xyz \(division by zero\)"):
        read(run("div"))


def test_a_plug_in_that_ends_the_process_does_not(installed, run):
    installed("fricjax-exit", "import sys; sys.exit(3)", bad="read")
    with pytest.raises(UsageError, match=r"fricjax-exit \(SystemExit: 3\)"):
        read(run("bad"))


def test_own_suffixes_ask_for_no_plug_in(installed, run, monkeypatch):
    installed("fricjax-csv", "import no_such_module", csv="read")
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: pytest.fail("plug-ins were searched"))
    assert read(run("csv"), column=1, time=0, unit="um").trace.n == 6
