"""`study.toml` sets up a study; errors name file, field and value."""

import pytest

import fricjax as fj
from fricjax.archive.study_file import read_study
from fricjax.data.read import example_paths
from fricjax.errors import UsageError
from tests.tables import check_rows

RIG = example_paths().rig.read_text()


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a study next to two rigs."""
    (tmp_path / "a.toml").write_text(RIG)
    (tmp_path / "b.toml").write_text(RIG.replace("9.66", "5.0"))

    def write(text):
        (tmp_path / "study.toml").write_text(text)
        return tmp_path / "study.toml"

    return write


def test_files_get_the_first_rule_that_takes_them(written):
    study = read_study(
        written(
            """
            friction = ["coulomb", "coulomb+quadraticdrag"]
            free = "mu,damping,stiffness"
            rig = "a.toml"
            facts = "load_{load}N/run_{number}.csv"
            bounds = { damping = "0:" }
            priors = { damping = "0.175(2)" }
            start = 0.2
            reading = { unit = "um" }
            [[runs]]
            pattern = "lab_b/**"
            rig = "b.toml"
            reading = { column = "x" }
            """
        )
    )
    assert [law.name for law in study.laws] == ["coulomb", "coulomb+quadraticdrag"]
    assert study.laws[0].free == ("mu", "damping", "stiffness")
    ours, theirs = study.rule_of("lab_a/1.csv"), study.rule_of("lab_b/may/1.csv")
    assert (ours.rig_name, ours.reading) == ("a.toml", {"unit": "um"})
    assert (theirs.rig_name, theirs.reading) == ("b.toml", {"unit": "um", "column": "x"})
    assert study.load_of("lab_a/1.csv") == 9.66 and study.load_of("lab_b/may/1.csv") == 5.0
    assert float(study.request(study.laws[0], theirs, 5.0).oscillator.normal_force) == 5.0
    assert study.settings["bounds"] == {"damping": (0.0, None)} and study.settings["start"] == 0.2


def test_without_a_rig_of_the_study_those_of_the_rules_count(written):
    rules = [f"[[runs]]\npattern = '{name}/**'\nrig = '{name}.toml'" for name in "ba"]
    study = read_study(written("\n".join(["free = ['mu', 'damping']", *rules])))
    assert study.laws[0].free == ("mu", "damping")
    assert study.rule_of("a/1.csv").rig and not study.calibrated and study.rule_of("c/1.csv").rig is None


REFUSED = [
    (
        "rig = 'a.toml'\nfrictoin = 'coulomb'",
        r"study.toml: there is no key 'frictoin' in a study file. Did you mean 'friction'\?",
    ),
    ("[[runs]]\nrig = 'b.toml'", r"study.toml: 'runs\[1\].pattern' is missing"),
    ("[[runs]]\npattern = '**'\nrgi = 'b.toml'", r"no key 'runs\[1\].rgi' in a study file. Did you mean 'rig'\?"),
    ("friction = 3", "study.toml: 'friction' must be a text in quotes or a list, got 3"),
    ("guess = { mu = 'much' }", "study.toml: 'guess.mu' must be a number, got 'much'"),
    ("friction = 'strybeck'", r"study.toml: There is no friction law 'strybeck'. Did you mean 'stribeck'\?"),
    (
        "friction = 'stribeck'\nrig = 'a.toml'",
        "study.toml: Stribeck friction without mu_s .* give it with fix mu_s",
    ),
    ("free = ['muh', 'stiffness']", "study.toml: This oscillator has no coefficient 'muh'"),
    ("bounds = { damping = 'low' }", "study.toml: bounds.damping 'low' is no span"),
    ("rig = 'c.toml'", "There is no rig file '.*c.toml'"),
    ("start = 'relaese'", "study.toml: There is no start 'relaese'. Did you mean 'release'"),
    ("friction = [", "study.toml: this is no valid TOML file"),
]


def test_errors_are_refused(written):
    def check(text, words):
        with pytest.raises(UsageError, match=words):
            read_study(written(text))

    check_rows(check, REFUSED)


def test_a_study_file_stands_alone(written, tmp_path):
    with pytest.raises(UsageError, match="already defines the model and its settings: leave the other arguments out"):
        fj.batch(written("rig = 'a.toml'"), tmp_path / "out", rig=tmp_path / "a.toml")
    with pytest.raises(UsageError, match=r"There is no study file '.*studdy.toml'. Did you mean 'study.toml'"):
        fj.batch(tmp_path / "studdy.toml", tmp_path / "out")
