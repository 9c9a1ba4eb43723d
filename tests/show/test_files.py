"""Atomic writing of files, and protection of existing ones."""

import errno
import os
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from fricjax.show import files
from fricjax.show.files import write_bytes, write_text
from tests.helpers import largest

ROOT = Path(__file__).resolve().parents[2]

KILLS = """
import os, random, signal, sys, time
from pathlib import Path
from fricjax.show.files import write_bytes
target, parts = Path(sys.argv[1]), 0
size = 1 << 22
write_bytes(target, b"0" * size)
for kill in range(20):
    begun, begin = os.pipe()
    child = os.fork()
    if not child:
        for letter in b"ab" * 1000:
            os.write(begin, b".")
            write_bytes(target, bytes([letter]) * size, overwrite=True)
        os._exit(0)
    os.read(begun, 1)
    time.sleep(random.Random(kill).uniform(0, 0.01))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    content = target.read_bytes()
    assert len(content) == size and content == content[:1] * size, f"a part of a file after kill {kill}"
    left = [path for path in target.parent.iterdir() if path != target]
    assert len(left) <= 1, left
    parts += len(left)
write_bytes(target, b"the end", overwrite=True)
print(parts, *target.parent.iterdir())
"""


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_kill_leaves_the_old_file_or_the_new_one_and_its_rest_goes_with_the_next(tmp_path):
    ran = subprocess.run([sys.executable, "-c", KILLS, tmp_path / "run.csv"], cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    parts, *left = ran.stdout.split()
    assert int(parts) > 5, "hardly a kill met a write"
    assert left == [str(tmp_path / "run.csv")]


def test_a_file_that_exists_stays_unless_it_may_go(tmp_path):
    path = tmp_path / "fit.json"
    assert write_text(path, "old") == path
    with pytest.raises(FileExistsError, match=r"exists already; give overwrite=True, or another name: '.*fit\.json'"):
        write_text(path, "new")
    assert path.read_text() == "old"
    write_text(path, "new", overwrite=True)
    assert path.read_text() == "new"
    assert names(tmp_path) == ["fit.json"]


def test_without_space_the_old_file_stays(tmp_path):
    path = tmp_path / "fit.json"
    write_text(path, "old")
    with largest(1000), pytest.raises(OSError, match="no space left") as caught:
        write_bytes(path, bytes(5000), overwrite=True)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(path))
    assert (path.read_text(), names(tmp_path)) == ("old", ["fit.json"])


@pytest.mark.parametrize(
    ("code", "kind", "sentence"),
    [
        (errno.ENOSPC, OSError, "no space left on its disk; nothing was written"),
        (errno.EDQUOT, OSError, "no space left in the quota"),
        (errno.EROFS, OSError, "its folder cannot be written to"),
        (errno.EACCES, PermissionError, "its folder cannot be written to"),
        (errno.EIO, OSError, os.strerror(errno.EIO)),
    ],
)
def test_the_error_tells_the_file_that_was_asked_for(tmp_path, monkeypatch, code, kind, sentence):
    def refuse(*_):
        raise OSError(code, "as the system words it", "a temporary name")

    monkeypatch.setattr(files.os, "fsync", refuse)
    with pytest.raises(kind, match=sentence) as caught:
        write_text(tmp_path / "fit.json", "new")
    assert caught.value.filename == str(tmp_path / "fit.json")
    assert names(tmp_path) == []


def test_folders(tmp_path):
    with pytest.raises(FileNotFoundError, match="its folder does not exist; make it first"):
        write_text(tmp_path / "none" / "fit.json", "new")
    with pytest.raises(IsADirectoryError, match="it is a folder"):
        write_text(tmp_path, "new", overwrite=True)


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444])
def test_mode_and_owner_stay(tmp_path, mode):
    path = tmp_path / "rig.toml"
    path.write_text("old")
    path.chmod(mode)
    if os.getuid() == 0:
        os.chown(path, 12345, 54321)
    before = path.stat()
    write_text(path, "new", overwrite=True)
    after = path.stat()
    assert (path.read_text(), stat.S_IMODE(after.st_mode)) == ("new", mode)
    assert (after.st_uid, after.st_gid) == (before.st_uid, before.st_gid)


def test_a_new_file_has_the_mode_that_all_files_of_the_process_get(tmp_path):
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "fit.json", "new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "fit.json").stat().st_mode) == 0o640


def test_a_link_stays_and_its_file_is_written(tmp_path):
    (tmp_path / "kept").mkdir()
    link, target = tmp_path / "rig.toml", tmp_path / "kept" / "rig.toml"
    link.symlink_to(target)
    write_text(link, "old")
    with pytest.raises(FileExistsError):
        write_text(link, "new")
    write_text(link, "new", overwrite=True)
    assert link.is_symlink() and not target.is_symlink() and target.read_text() == "new"
    assert (names(tmp_path), names(tmp_path / "kept")) == (["kept", "rig.toml"], ["rig.toml"])


def test_what_a_killed_process_left_goes_and_what_a_live_one_writes_stays(tmp_path):
    orphan, note = tmp_path / f".fricjax-{16 * '0'}.tmp", tmp_path / ".fricjax-notes.tmp"
    orphan.write_text("a par")
    note.write_text("mine")
    with files._temporary(tmp_path, 0o600) as live:
        write_text(tmp_path / "fit.json", "new")
        assert names(tmp_path) == sorted([Path(os.fsdecode(live.name)).name, note.name, "fit.json"])
    assert names(tmp_path) == [note.name, "fit.json"]


def test_of_many_threads_one_makes_the_file(tmp_path):
    path, outcomes = tmp_path / "run.csv", []
    start = threading.Barrier(8)

    def work(letter: bytes) -> None:
        start.wait()
        try:
            write_bytes(path, letter * 100_000)
            outcomes.append(letter)
        except FileExistsError:
            outcomes.append(None)

    crowd = [threading.Thread(target=work, args=(bytes([97 + i]),)) for i in range(8)]
    for each in crowd:
        each.start()
    for each in crowd:
        each.join()
    (winner,) = [letter for letter in outcomes if letter]
    assert len(outcomes) == 8
    assert (path.read_bytes(), names(tmp_path)) == (winner * 100_000, ["run.csv"])


def test_a_disk_without_hard_links_is_written_to(tmp_path, monkeypatch):
    def none(_, target):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(files.os, "link", none)
    write_text(tmp_path / "fit.json", "new")

    def late(_, target):
        target.write_text("theirs")
        none(_, target)

    monkeypatch.setattr(files.os, "link", late)
    with pytest.raises(FileExistsError):
        write_text(tmp_path / "other.json", "ours")
    assert (tmp_path / "other.json").read_text() == "theirs"
    assert names(tmp_path) == ["fit.json", "other.json"]
