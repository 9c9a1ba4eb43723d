"""Content of a page: exact numbers, grouped reasons, limits, harmless texts."""

import base64
import hashlib
import html.parser
import json
import re
from importlib import resources

import numpy as np
import pandas as pd
import pytest

import fricjax as fj
from fricjax.errors import DataError, UsageError
from fricjax.report.judgement import reasons, summary
from fricjax.report.pictures import CURVES, Curves, encoded, half_cycles_of
from fricjax.show.thumbnail import sketched
from tests.report.archives import archive

SCRIPTS = [path for path in resources.files("fricjax.report").joinpath("assets").iterdir() if path.name.endswith(".js")]


class Parsed(html.parser.HTMLParser):
    """Elements of a page with attributes, and text of scripts and style."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.texts, self.inside = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self.inside = tag in ("script", "style")
        if self.inside:
            self.texts.append("")

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.texts[-1] += data

    @property
    def data(self):
        scripts = [(attributes, text) for (_, attributes), text in zip(self.blocks, self.texts, strict=True)]
        return json.loads(next(text for attributes, text in scripts if attributes.get("id") == "data"))

    @property
    def blocks(self):
        return [(tag, attributes) for tag, attributes in self.elements if tag in ("script", "style")]


@pytest.fixture(scope="module")
def frame():
    return archive(60)


@pytest.fixture(scope="module")
def parsed(frame):
    return Parsed(fj.report.page(frame))


@pytest.fixture(scope="module")
def fit():
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
    return fj.fit(run, machine, ["mu", "damping", "stiffness"])


def column(data, name):
    return next(each for each in data["columns"] if each["name"] == name)


def numbers(entry, field="values"):
    return np.frombuffer(base64.b64decode(entry[field]), "<f8")


def test_the_policy_names_each_script_by_its_hash_and_nothing_else(parsed):
    (policy,) = [a["content"] for tag, a in parsed.elements if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; ")
    assert not re.search(r"unsafe|https?:|data:|\*", policy)
    for (tag, attributes), text in zip(parsed.blocks, parsed.texts, strict=True):
        named = f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" in policy
        assert named == (tag == "style" or "type" not in attributes)


def test_nothing_is_loaded(parsed):
    assert not [e for e in parsed.elements if {"src", "href", "style", "onload"} & e[1].keys() and e[0] != "a"]
    assert {tag for tag, _ in parsed.elements} <= {
        *("html", "head", "meta", "title", "style", "body", "a", "header", "h1", "main", "noscript", "p", "footer"),
        "script",
    }


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_scripts_make_no_markup_of_texts_and_evaluate_nothing(path):
    text = path.read_text()
    assert not re.search(r"innerHTML|outerHTML|insertAdjacent|document\.write|\beval\b|new Function|javascript:", text)
    assert "</script" not in text and "<!--" not in text
    assert max(map(len, text.splitlines())) < 240


def test_hostile_texts_stay_texts(frame):
    hostile = "</script><script>alert(1)</script><!-- ${title} $title ]]> \ud800 \u202e"
    names = pd.Series([f"{hostile}{i}" for i in range(len(frame))], dtype=object)
    table = frame.astype(object).assign(file=names, outcome=hostile[:40], rig=hostile[:40])
    table[hostile[:40]] = hostile[:40]
    text = fj.report.page(table, title=f"<b>{hostile}")
    assert Parsed(text).blocks == Parsed(fj.report.page(frame)).blocks
    data = Parsed(text).data
    assert column(data, "file")["words"][3] == f"{hostile}3"
    assert column(data, hostile[:40])["words"] == [hostile[:40]]
    assert data["title"] == f"<b>{hostile}"
    text.encode("utf-8")


def test_numbers_keep_their_digits_in_the_unit_of_their_column(parsed, frame):
    data = parsed.data
    mu = column(data, "mu")
    np.testing.assert_array_equal(numbers(mu), frame["mu"])
    np.testing.assert_array_equal(numbers(mu, "std"), frame["mu_std"])
    band, damping = column(data, "dead_band"), column(data, "damping")
    assert (band["unit"], damping["unit"], column(data, "load")["unit"]) == ("um", "mN s/m", "N")
    np.testing.assert_allclose(numbers(band), 1e6 * frame["dead_band"], rtol=1e-15)
    row = frame["mu"].first_valid_index()
    expected = fj.show.uncertain(frame["mu"][row], frame["mu_combined_std"][row])
    assert mu["text"][row] == expected
    assert mu["text"][frame["mu"].isna().to_numpy().argmax()] == ""


def test_curves_come_back_within_half_a_level():
    generator = np.random.default_rng(0)
    arrays = [generator.standard_normal(size) for size in (5, 0, 8, 1)]
    arrays[2][3] = np.nan
    runs = encoded([Curves.of(arrays)] * len(CURVES))
    assert [len(run) % 4 for run in runs] == [0, 0, 0, 0]
    assert runs[1] == b""
    for array, run in zip(arrays, runs, strict=True):
        if array.size:
            assert int.from_bytes(run[:4], "little") == array.size
            low, high = np.frombuffer(run[4:12], "<f4")
            levels = np.frombuffer(run[12 : 12 + 2 * array.size], "<u2")
            decoded = np.where(levels == 65535, np.nan, low + levels * (high - low) / 65534)
            np.testing.assert_allclose(decoded, array, atol=1e-6 + (high - low) / 65534)


def test_points_beyond_float32_count_as_missing():
    damaged, clean = (Curves.of([np.array([0.0, 1.0, beyond, beyond])]) for beyond in (1e250, np.nan))
    infinite = Curves.of([np.array([0.0, 1.0, np.inf, -np.inf])])
    assert encoded([damaged]) == encoded([infinite]) == encoded([clean])


def test_friction_of_half_cycles_is_that_of_a_simulated_decay():
    machine = fj.Oscillator(0.4, 2500.0, 0.4, 10.0, fj.friction.Coulomb(0.05))
    motion = fj.simulate(machine, 5e-3, np.linspace(0, 2, 200001))
    t, x, v = (np.asarray(each) for each in (motion.t, motion.x, motion.v))
    at = np.flatnonzero(np.diff(np.sign(v)) != 0)[1:]
    points = np.asarray(motion.turning_points)[: int(motion.n_half_cycles) + 1]
    map_ = half_cycles_of(np.append(0.0, t[at])[: points.size], points, float(machine.damping_ratio))
    np.testing.assert_allclose(map_.dead_band, float(machine.dead_band), rtol=1e-6)
    mean = np.abs(np.diff(points)) * float(machine.angular_frequency) / np.pi
    np.testing.assert_allclose(np.abs(map_.speed)[:3], mean[:3], rtol=1e-3)
    shifted = half_cycles_of(np.append(0.0, t[at])[: points.size], points + 1e-5, float(machine.damping_ratio))
    np.testing.assert_allclose(shifted.dead_band, float(machine.dead_band), rtol=1e-6)
    assert half_cycles_of(t[:3], x[:3], np.nan).speed.size == 0


def test_limits_are_three_deviations_of_what_was_drawn(frame):
    table = archive(3000, broken=0.0)
    report, limits = summary(table, "m")
    mu = next(limit for limit in limits if limit.name == "mu")
    assert mu.mean == pytest.approx(0.02, abs=4 * 3e-4 / 3000**0.5)
    assert mu.high - mu.low == pytest.approx(6 * 3e-4, rel=0.05)
    beyond = np.sum((table["mu"] < mu.low) | (table["mu"] > mu.high))
    assert 0 < beyond < 25  # 8 are expected
    assert ("runs", "3,000: 3,000 ok") in report.facts
    assert "dead_band" not in {limit.name for limit in limits}
    for load in (5.0, np.nan):
        assert "dead_band" in {limit.name for limit in summary(table.assign(load=load), "m")[1]}


def test_laws_have_limits_of_their_own():
    table = archive(40, broken=0.0)
    table.loc[::2, "friction"] = "dahl"
    table.loc[::2, "mu"] += 0.1
    limits = {limit.law: limit.mean for limit in summary(table, "m")[1] if limit.name == "mu"}
    assert limits == pytest.approx({"coulomb": 0.02, "dahl": 0.12}, abs=1e-3)


def test_reasons_are_grouped_by_what_is_alike():
    sentences = [
        "Row 12 of a/b.csv is no number: '#REF!'.",
        "Row 7 of c.csv is no number: '?'.",
        "at a bound: mu ended at 0.1",
        "at a bound: damping ended at 1e-3",
        "converged",
    ]
    status = ["rejected", "rejected", "invalid", "invalid", "ok"]
    groups, of = reasons(pd.DataFrame({"status": status, "outcome": sentences, "file": ["a/b.csv", "c.csv", *"xyz"]}))
    assert [(group["status"], group["reason"], group["runs"]) for group in groups] == [
        ("rejected", "Row … of … is no number: ….", 2),
        ("invalid", "at a bound", 2),
    ]
    assert of.tolist() == [0, 0, 1, 1, -1]


@pytest.mark.slow
def test_a_fit_has_the_pictures_of_its_runs(fit):
    data = Parsed(fj.report.page(fit)).data
    assert data["rows"] == 1 and data["pictures"]["frictionIsMu"]
    assert data["report"]["tables"][0]["rows"][0][0] == "mu"
    fitted = np.frombuffer(base64.b64decode(data["pictures"]["fitted"]), "<f4")
    assert fitted == pytest.approx([0.05], rel=1e-5)


def test_a_sketch_has_the_highest_and_the_lowest_sample():
    values = np.random.default_rng(1).standard_normal(10_000)
    kept = sketched(values, 100)
    assert np.all(np.diff(kept) > 0) and kept.size == 100
    assert {int(values.argmax()), int(values.argmin())} <= set(kept.tolist())
    assert np.abs(values[kept]).min() > 1.0
    np.testing.assert_array_equal(sketched(values[:50], 100), np.arange(50))


def test_other_results_and_their_paths(fit, tmp_path):
    force_map = fj.friction_force_map(fj.data.example_paths().run, fj.Rig.from_toml(fj.data.example_paths().rig))
    data = Parsed(fj.report.page(force_map)).data
    assert "rows" not in data and data["report"]["facts"]
    path = fit.save(tmp_path / "fit.json")
    assert fj.report.save(path, tmp_path / "fit.html").read_text().startswith("<!doctype html>")
    with pytest.raises(FileExistsError):
        fj.report.save(path, tmp_path / "fit.html")


def test_an_archive_is_shown_from_its_folder(tmp_path):
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    for i, x0 in enumerate((2e-3, 2.2e-3, 2.4e-3)):
        fj.write(fj.synthetic_run(machine, x0, rate=2e3, duration=0.6, noise=1e-9, seed=i), tmp_path / f"run_{i}.csv")
    (tmp_path / "run_3.csv").write_text("t [s],x [m]\n")
    store = fj.batch(sorted(tmp_path.glob("*.csv")), tmp_path / "results", machine)
    data = Parsed(fj.report.page(tmp_path / "results")).data
    assert (data["title"], data["rows"]) == ("Archive results", 4)
    assert [size > 0 for size in data["pictures"]["sizes"]] == [True, True, True, False]
    np.testing.assert_allclose(numbers(column(data, "mu"))[:3], 0.05, rtol=1e-5)
    assert [each["runs"] for each in data["reasons"]] == [1]
    of_archive = Parsed(fj.report.page(store)).data
    assert {**of_archive, "made": ""} == {**data, "made": ""}


@pytest.mark.parametrize(
    ("source", "kind", "words"),
    [
        (3, UsageError, "A page shows a fit, an archive or another result, not int"),
        ("nowhere", DataError, "There is no file or folder nowhere"),
        (pd.DataFrame({"file": [], "status": []}), DataError, "holds no run"),
        (pd.DataFrame({"status": ["ok"], "fil": ["a"]}), DataError, "'file' is missing. Did you mean 'fil'?"),
    ],
)
def test_what_is_no_result_is_refused(source, kind, words):
    with pytest.raises(kind, match=re.escape(words)):
        fj.report.page(source)


def test_a_page_has_the_ending_of_one(fit, tmp_path):
    with pytest.raises(UsageError, match=r"give it the ending \.html"):
        fj.report.save(fit, tmp_path / "fit.pdf")


def test_a_table_with_little_in_it_makes_a_page():
    data = Parsed(fj.report.page(pd.DataFrame({"file": ["a", "b"], "status": ["failed", "ok"]}))).data
    assert data["limits"] == [] and data["keys"] == ["0", "1"]
    assert data["reasons"] == [{"status": "failed", "reason": "", "runs": 1}]
