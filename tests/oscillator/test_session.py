"""What was compiled once is not compiled again in the next process, and nobody else's settings are touched."""

import json
import os
import stat
import subprocess
import sys

import pytest

from fricjax.oscillator.kept import prune
from fricjax.oscillator.session import programs_folder

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
at = jax.config.jax_compilation_cache_dir
counts = {"hits": seen.count("cache_hits"), "misses": seen.count("cache_misses")}
print(json.dumps({"imported": imported, "at": at, **counts}))
"""


def told(**variables):
    """What a fresh process tells of its cache, with these environment variables and none of the tests' own."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "FRICJAX_"))}
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT], env={**kept, **variables}, capture_output=True, text=True, check=True
    )
    return json.loads(ran.stdout)


def test_the_next_process_compiles_nothing_again(tmp_path):
    first, second = (told(FRICJAX_CACHE_DIR=str(tmp_path)) for _ in range(2))
    assert first["imported"] is None
    assert first["hits"] == 0 < first["misses"] == second["hits"]
    assert second["misses"] == 0
    (folder,) = tmp_path.iterdir()
    assert first["at"] == str(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


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
    prune(tmp_path, 299)  # down to 80 %
    assert {path.name for path in tmp_path.iterdir()} == {"new", "old"}
