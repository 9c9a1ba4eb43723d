"""The store keeps finished runs and ignores half-written files."""

import errno
import os

import numpy as np
import pytest

import fricjax as fj
from fricjax.archive import Law, Rule, Study
from fricjax.archive.plan import Signature, hash_of, iso_time, plan
from fricjax.archive.store import Store
from fricjax.archive.table import COLUMNS, joined, of_rows
from fricjax.archive.work import Done
from fricjax.errors import DataError, UsageError

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
LAW = Law("coulomb", MACHINE, ("mu", "damping", "stiffness"))


@pytest.fixture
def study(tmp_path):
    """Write eight files that no test reads."""
    folder = tmp_path / "runs"
    folder.mkdir()
    for number in range(8):
        (folder / f"run_{number}.csv").write_text(f"{number}\n" * (number + 1))
    return Study(folder, (LAW,), facts=("run_{number}.csv",))


def made_up(job, work, status="ok"):
    """Return a row like that of a worker."""
    (row,) = work.unfitted((job,), {"status": "failed", "outcome": "made up"}).rows
    return {**row, "status": status, "mu": 0.05, "sha256": hash_of(work.study.root / job.file)}


def one_by_one(chunks, work):
    for chunk in chunks:
        for job in chunk:
            yield (job,), Done([made_up(job, work)], {})


def until(end):
    """Return an executor that raises `end` after three files."""

    def execute(chunks, work):
        for number, done in enumerate(one_by_one(chunks, work)):
            if number == 3:
                raise end
            yield done

    return execute


@pytest.mark.parametrize("end", [KeyboardInterrupt(), MemoryError()])
def test_what_is_done_is_kept(study, tmp_path, end):
    with pytest.raises(type(end)):
        fj.batch(study, tmp_path / "out", execute=until(end))
    assert len(fj.open_archive(tmp_path / "out")) == 3
    progress = []
    archive = fj.batch(study, tmp_path / "out", execute=one_by_one, tell=lambda *words: progress.append(words[:2]))
    assert progress == [(number, 5) for number in range(1, 6)]
    assert archive.to_dataframe()["number"].tolist() == list(range(8))


def test_a_full_disk_loses_no_record(study, tmp_path, monkeypatch):
    from fricjax.archive import store

    write, written = store.write_bytes, []

    def limited(path, content, **options):
        if len(written) >= 3:
            raise OSError(errno.ENOSPC, "no space left on its disk", str(path))
        written.append(path)
        return write(path, content, **options)

    monkeypatch.setattr(store, "write_bytes", limited)
    with pytest.raises(OSError, match=r"no space left on its disk. 3 of 8 files are done and kept"):
        fj.batch(study, tmp_path / "out", execute=one_by_one)
    monkeypatch.undo()
    assert len(fj.open_archive(tmp_path / "out")) == 3
    assert len(fj.batch(study, tmp_path / "out", execute=one_by_one)) == 8


def test_a_table_that_cannot_be_written_is_reported(study, tmp_path, monkeypatch):
    def full(store, root=None):
        raise OSError(errno.ENOSPC, "no space left on its disk", str(store.path / "table.parquet"))

    with monkeypatch.context() as patch:
        patch.setattr(Store, "write_table", full)
        with pytest.raises(OSError, match="All files are done and their rows kept; start again to write the table"):
            fj.batch(study, tmp_path / "out", execute=one_by_one)
    assert len(fj.batch(study, tmp_path / "out", execute=one_by_one)) == 8


def test_a_clock_set_back_changes_nothing(study, tmp_path, monkeypatch):
    fj.batch(study, tmp_path / "out", execute=one_by_one)
    file = study.root / "run_3.csv"
    file.write_text("changed\n")
    monkeypatch.setattr("time.time_ns", lambda: 10**18)
    fj.batch(study, tmp_path / "out", execute=one_by_one)
    table = fj.batch(study, tmp_path / "out", execute=one_by_one).to_dataframe()
    assert table.set_index("file").sha256["run_3.csv"] == hash_of(file) and len(table) == 8


def test_a_driver_killed_before_its_first_file_can_be_continued(study, tmp_path):
    for name in ("parts", "runs"):
        (tmp_path / "out" / name).mkdir(parents=True)
    assert len(fj.batch(study, tmp_path / "out", execute=one_by_one)) == 8
    fj.batch(study, tmp_path / "other", execute=one_by_one)
    for part in (tmp_path / "other" / "parts").iterdir():
        part.unlink()
    (tmp_path / "other" / "parts").rmdir()
    (tmp_path / "other" / "table.parquet").unlink()
    assert len(fj.batch(study, tmp_path / "other", execute=one_by_one)) == 8


@pytest.mark.skipif(os.name == "nt", reason="file names are text there")
def test_a_name_that_is_no_text_stops_no_other_run(study, tmp_path):
    odd = os.fsencode(study.root) + b"/run_\xff.csv"
    with open(odd, "wb") as file:
        file.write(b"t,x\n0,1\n")
    for _ in range(2):
        table = fj.batch(study.root, tmp_path / "out", MACHINE, include=["run_?.csv"], exclude=["run_?.txt"])
        rows = table.to_dataframe().set_index("file")
        assert len(rows) == 9 and rows.status[r"run_\xff.csv"] == "rejected"
        assert "is no name of a file; rename the file" in rows.outcome[r"run_\xff.csv"]


def test_links_to_folders_are_named(study, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (study.root / "linked").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    assert plan(study).links == ("linked",)
    with pytest.warns(UserWarning, match="Links to folders are not followed: linked"):
        fj.batch(study, tmp_path / "out", execute=one_by_one)


def test_a_query_has_no_files(study, tmp_path, monkeypatch):
    archive = fj.batch(study, tmp_path / "out", execute=one_by_one)
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".tmp").mkdir()
    for sql in ("copy (select 1) to '.tmp/x.csv'", "select * from read_text('.tmp/*')"):
        with pytest.raises(UsageError, match="DuckDB refuses the query"):
            archive.query(sql)
    assert list((tmp_path / ".tmp").iterdir()) == []


def test_what_is_half_written_is_not_read(study, tmp_path):
    out = tmp_path / "out"
    fj.batch(study, out, execute=one_by_one)
    part = next((out / "parts").iterdir())
    (out / "parts" / ".fricjax-0123456789abcdef.tmp").write_bytes(part.read_bytes()[:100])
    assert len(fj.open_archive(out)) == 8
    damaged = out / "parts" / "99999999999999999999-aa.parquet"
    damaged.write_bytes(part.read_bytes()[:100])
    with pytest.raises(DataError, match=r"99999999999999999999-aa.parquet cannot be read .* Remove it and start again"):
        fj.open_archive(out)


def test_a_table_that_is_gone_is_made_of_its_parts(study, tmp_path):
    before = fj.batch(study, tmp_path / "out", execute=one_by_one).to_dataframe()
    (tmp_path / "out" / "table.parquet").unlink()
    after = fj.open_archive(tmp_path / "out").to_dataframe()
    assert before.astype(str).equals(after.astype(str))


def test_failed_runs_are_tried_again_on_request(study, tmp_path):
    def failing(chunks, work):
        for chunk in chunks:
            statuses = ["failed" if job.file == "run_3.csv" else "ok" for job in chunk]
            yield (
                chunk,
                Done([made_up(*pair[:1], work, pair[1]) for pair in zip(chunk, statuses, strict=True)], {}),
            )

    first = fj.batch(study, tmp_path / "out", execute=failing)
    assert first.counts == {"ok": 7, "invalid": 0, "rejected": 0, "failed": 1}
    assert fj.batch(study, tmp_path / "out", execute=one_by_one).counts["failed"] == 1
    again = fj.batch(study, tmp_path / "out", execute=one_by_one, retry_failed=True)
    assert again.counts["failed"] == 0 and len(again) == 8


def test_shards_share_the_files(study):
    chunks = [chunk for part in (1, 2, 3) for chunk in plan(study, shard=(part, 3)).chunks]
    assert sorted(job.file for chunk in chunks for job in chunk) == [f"run_{number}.csv" for number in range(8)]


def test_hidden_files_stores_and_loops_are_no_runs(study, tmp_path):
    (study.root / ".hidden.csv").write_text("1")
    (study.root / "notes.xyz").write_text("1")
    (study.root / "loop").symlink_to(study.root)
    (study.root / "out" / "parts").mkdir(parents=True)
    (study.root / "out" / "kept.csv").write_text("1")
    assert len(plan(study, store=study.root / "out").files) == 8


def test_keys_follow_bytes_settings_and_law(study):
    rule, other = Rule(), Rule(reading={"unit": "um"})
    digests = {
        study.digest(LAW, rule, 10.0),
        study.digest(LAW, rule, 12.0),
        study.digest(LAW, other, 10.0),
        study.digest(Law("coulomb", MACHINE, ("mu",)), rule, 10.0),
        Study(study.root, (LAW,), settings={"start": "release"}).digest(LAW, rule, 10.0),
    }
    assert len(digests) == 5
    same = Study(study.root / "elsewhere", (LAW,), facts=("{a}.csv",)).digest(LAW, rule, 10.0)
    assert same == study.digest(LAW, rule, 10.0)


def test_rows_of_several_laws_have_the_columns_of_all():
    row = {**dict.fromkeys(("key", "run", "status", "sha256", "settings"), "a"), "file": "3"}
    parts = [of_rows([{**row, "friction": "coulomb", "mu": 0.1}]), of_rows([{**row, "friction": "b", "sigma0": 2.0}])]
    table = joined([("1", parts[0]), ("2", parts[1])], ["{day}"])
    names = table.column_names
    assert set(COLUMNS) | {"mu", "sigma0", "day"} == set(names)
    assert names.index("warnings") < names.index("mu") < names.index("chi2_reduced") < names.index("day")
    frame = table.to_pandas()
    assert frame["mu"].isna().tolist() == [True, False] and frame["day"].tolist() == [3.0, 3.0]


def test_cells_are_no_formulas(study, tmp_path):
    os.rename(study.root / "run_0.csv", study.root / "=1+1.csv")
    archive = fj.batch(study, tmp_path / "out", execute=one_by_one)
    text = archive.to_csv(tmp_path / "all.csv").read_text()
    assert "\n=" not in text and ",=" not in text and "'=1+1.csv" in text


def test_a_time_is_known_to_the_nanosecond():
    assert iso_time(1_700_000_000_123_456_789) == "2023-11-14T22:13:20.123456789Z"
    assert Signature(1, iso_time(1), 2) != Signature(1, iso_time(2), 2)


def test_questions_to_an_archive(study, tmp_path):
    archive = fj.batch(study, tmp_path / "out", execute=one_by_one)
    with pytest.raises(UsageError, match=r"no column 'mux'. Did you mean 'mu'"):
        archive.population("mux")
    with pytest.raises(UsageError, match=r"There is no row of 'coulomp'. Did you mean 'coulomb'"):
        archive.population("mu", friction="coulomp")
    assert archive.query("select sum(number) as n from runs")["n"].tolist() == [28.0]
    assert "8 rows of 8 files: 8 ok" in repr(archive) and "<table" in archive._repr_html_()


def test_populations_by_a_column_weigh_runs_by_their_errors(tmp_path):
    random = np.random.default_rng(1)
    rows = [
        {
            **dict.fromkeys(("run", "sha256", "settings"), ""),
            "key": str(i),
            "file": f"{i}.csv",
            "friction": "coulomb",
            "status": "ok" if i % 10 else "invalid",
            "mu": 0.1 * (1 + i % 2) + 1e-3 * random.standard_normal(),
            "mu_std": 1e-3,
            "mu_combined_std": 5e-3,
            "load": float(1 + i % 2),
        }
        for i in range(80)
    ]
    store = Store(tmp_path / "out")
    (store.path / "parts").mkdir(parents=True)
    store.begin(Study(tmp_path, (LAW,)))
    store.write_part(of_rows(rows))
    archive = fj.open_archive(store.path)
    found = archive.population("mu", by="load")
    assert list(found) == [1.0, 2.0] and found[1.0].runs == 32
    assert abs(found[1.0].mean - 0.1) < 5 * found[1.0].std and abs(found[2.0].mean - 0.2) < 5 * found[2.0].std
    # Errors common to all runs do not average out.
    assert found[1.0].std < 3e-4 and found[1.0].combined_std > 4.8e-3
    files = archive.to_dataframe()["file"].to_list()
    assert [int(files[row].partition(".")[0]) % 10 for row in found[1.0].left_out] == [0] * 8
