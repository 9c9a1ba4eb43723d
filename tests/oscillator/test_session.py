"""Compilation cache across processes, and unchanged settings of the user."""

import itertools
import json
import os
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path

import jax
import pytest

from fricjax.oscillator.cache import asked_folder, distrust, prune
from fricjax.oscillator.session import programs_folder

pytestmark = pytest.mark.slow

SCRIPT = """
import json
import jax
import jax.numpy as jnp
jax.config.update("jax_enable_x64", True)
seen = []
jax.monitoring.register_event_listener(lambda event, **_: seen.append(event.rsplit("/", 1)[-1]))
jnp.arange(3.0).sum()  # a program before the first of fricjax: JAX has looked for a folder
import fricjax as fj
imported = jax.config.jax_compilation_cache_dir
fj.simulate(fj.Oscillator(1.0, 5000.0, 0.0, 9.81, fj.friction.Coulomb(0.1)), 3e-3, jnp.array([0.5]))
for factor in (2.0, 3.0, 4.0):
    jax.jit(lambda x: factor * x)(jnp.arange(3.0))
at = jax.config.jax_compilation_cache_dir
counts = {"hits": seen.count("cache_hits"), "misses": seen.count("cache_misses")}
print(json.dumps({"imported": imported, "at": at, **counts}))
"""


def ran(**variables):
    """Run the script in a new process with the given environment variables.

    The JAX and fricjax variables of the tests are removed.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "FRICJAX_"))}
    return subprocess.run(
        [sys.executable, "-c", SCRIPT], env={**kept, **variables}, capture_output=True, text=True, check=True
    )


def told(**variables):
    """Report of the script on its cache."""
    return json.loads(ran(**variables).stdout)


FORKED = """
import os
import jax
jax.config.update("jax_enable_x64", True)
import fricjax as fj
machine = fj.Oscillator(1.0, 5000.0, 0.0, 9.81, fj.friction.Coulomb(0.1))
fj.simulate(machine, 3e-3, [0.0, 0.5])
child = os.fork()
if not child:
    try:
        fj.simulate(machine, 3e-3, [0.0, 0.5])
    except RuntimeError as error:
        os._exit(7 if "multiprocessing.get_context('spawn')" in str(error) else 8)
    os._exit(9)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows has no fork")
def test_a_forked_process_is_refused_at_once():
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.strip() == "7"


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """Folder of compiled programs, and report of the process that filled it."""
    folder = tmp_path_factory.mktemp("programs")
    return folder, told(FRICJAX_CACHE_DIR=str(folder))


@pytest.fixture
def programs(filled, tmp_path):
    """Copy of the filled folder."""
    return shutil.copytree(filled[0], tmp_path / "programs")


def test_the_next_process_compiles_nothing_again(filled):
    tmp_path, first = filled
    second = told(FRICJAX_CACHE_DIR=str(tmp_path))
    assert first["imported"] is None
    assert first["hits"] == 0 < first["misses"] == second["hits"]
    assert second["misses"] == 0
    (folder,) = tmp_path.iterdir()
    assert first["at"] == str(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


DAMAGE = {
    "cut": lambda data: data[: len(data) // 2],
    "empty": lambda data: b"",
    "flipped": lambda data: bytes([*data[:-40], data[-40] ^ 1, *data[-39:]]),
    "text": lambda data: b"no program at all",
}


def test_damaged_programs_are_made_again_in_silence(filled, programs):
    first, (folder,) = filled[1], programs.iterdir()
    files = sorted(folder.iterdir())
    assert len(files) >= len(DAMAGE)
    for path, damage in zip(files, itertools.cycle(DAMAGE.values()), strict=False):
        path.write_bytes(damage(path.read_bytes()))
    again = ran(FRICJAX_CACHE_DIR=str(programs))
    assert again.stderr == ""
    assert json.loads(again.stdout)["misses"] == first["misses"]
    last = told(FRICJAX_CACHE_DIR=str(programs))
    assert (last["hits"], last["misses"]) == (first["misses"], 0)
    assert sorted(folder.iterdir()) == files


def test_nothing_is_loaded_from_where_others_can_write(programs):
    (folder,) = programs.iterdir()
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    folder.chmod(0o770)
    found = ran(FRICJAX_CACHE_DIR=str(programs))
    assert found.stderr.count("Warning") == 1
    assert f"others can write to {folder}" in found.stderr and f"'chmod go-w {folder}'" in found.stderr
    at = json.loads(found.stdout)
    assert (at["at"], at["hits"]) == (None, 0)
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("above", "mode", "owner", "sentence"),
    [
        (0o700, 0o700, None, None),
        (0o755, 0o755, None, None),
        (0o1777, 0o700, None, None),  # like /tmp: others may add files, but not replace them
        (0o700, 0o720, None, "others can write to"),
        (0o700, 0o702, None, "others can write to"),
        (0o700, 0o1777, None, "others can write to"),
        (0o777, 0o700, None, "others can write to"),
        (0o700, 0o700, "folder", "belongs to another user"),
        (0o700, 0o700, "above", "belongs to another user"),
    ],
)
def test_whose_folder_it_must_be(tmp_path, monkeypatch, above, mode, owner, sentence):
    root, folder = tmp_path / "programs", tmp_path / "programs" / "processor"
    folder.mkdir(parents=True)
    root.chmod(above)
    folder.chmod(mode)
    stranger = {"folder": folder, "above": root}.get(owner)
    real = Path.stat
    if stranger is not None:
        # Only root can give folders away.
        changed = lambda path: os.stat_result((*real(path)[:4], os.getuid() + 1, *real(path)[5:]))
        monkeypatch.setattr(Path, "stat", lambda path, **_: changed(path) if path == stranger else real(path))
    found = distrust(folder)
    assert (found is None) if sentence is None else (found is not None and sentence in found), found


def test_doctor_says_why_there_is_no_cache(tmp_path, monkeypatch):
    from fricjax.cli.doctor import _cache_text, cache_facts

    monkeypatch.setenv("FRICJAX_CACHE_DIR", str(tmp_path))
    folder = asked_folder()
    assert folder is not None
    folder.mkdir(mode=0o700)
    folder.chmod(0o777)
    with pytest.warns(UserWarning, match="neither kept nor loaded: others can write to"):
        assert programs_folder() is None
    named = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update("jax_compilation_cache_dir", None)
    found = _cache_text(cache_facts())
    jax.config.update("jax_compilation_cache_dir", named)
    assert found.startswith(f"off: others can write to {folder}, ")


def test_a_folder_that_the_user_gave_to_jax_stays(tmp_path):
    found = told(FRICJAX_CACHE_DIR=str(tmp_path / "ours"), JAX_COMPILATION_CACHE_DIR=str(tmp_path / "theirs"))
    assert found["imported"] == found["at"] == str(tmp_path / "theirs")
    assert not (tmp_path / "ours").exists()


@pytest.mark.parametrize("word", ["off", "", " None "])
def test_it_can_be_switched_off(monkeypatch, word):
    monkeypatch.setenv("FRICJAX_CACHE_DIR", word)
    assert programs_folder() is None


def test_a_folder_that_cannot_be_made_is_none(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("FRICJAX_CACHE_DIR", str(tmp_path / "file"))
    assert programs_folder() is None


def test_it_is_the_users_cache_unless_named(monkeypatch, tmp_path):
    monkeypatch.delenv("FRICJAX_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = programs_folder()
    assert folder is not None
    assert folder.parent == tmp_path / "fricjax"


def test_what_was_not_used_for_long_goes(tmp_path):
    for age, name in enumerate(("new", "old", "oldest")):
        path = tmp_path / name
        path.write_bytes(bytes(100))
        os.utime(path, (1e9 - age, 1e9 - age))
    prune(tmp_path, 300)
    assert len(list(tmp_path.iterdir())) == 3
    for age in (0, 7200):
        path = tmp_path / f"killed{age}.unfinished"
        path.write_bytes(b"")
        os.utime(path, (time.time() - age, time.time() - age))
    prune(tmp_path, 300)
    assert len(list(tmp_path.iterdir())) == 4
    (tmp_path / "killed0.unfinished").unlink()
    prune(tmp_path, 299)  # down to 80 %
    assert {path.name for path in tmp_path.iterdir()} == {"new", "old"}
