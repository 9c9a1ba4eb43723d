"""Wrong paths, names, numbers and units are refused before any large import.

One fresh process makes all refusals. After each one it reports the large packages that are loaded.
"""

import json
import subprocess
import sys

import pytest

from tests.helpers import python_in
from tests.tables import check_rows

LARGE = ("jax", "jaxlib", "equinox", "diffrax", "scipy", "pandas", "h5py", "matplotlib", "pint")
_ALL = f"""
import contextlib, io, json, sys
from fricjax.cli.main import run
found = []
for words in json.load(sys.stdin):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([*words, "--json"])
    found.append([code, json.loads(out.getvalue())["error"], err.getvalue(), [n for n in {LARGE} if n in sys.modules]])
json.dump(found, sys.stdout)
"""
RIG = ("--rig", "rig.toml")
PATHS = [
    (("fit", "god.csv"), "There is no file god.csv. Did you mean 'good.csv'? Check the path.", 4),
    (("fit", "nowhere/run.csv"), "There is no file nowhere/run.csv, for there is no folder nowhere.", 4),
    (("fit", "."), ". is a folder, not a file; name one record in it; it holds broken.toml, ", 4),
    (("fit", "go*.csv"), "go*.csv is a pattern, not a file; it matches good.csv. Name each file,", 4),
    (("fit", "x*.csv"), "There is no file x*.csv, and none that matches this pattern.", 4),
    (("fit", "empty.csv"), "empty.csv is empty: it holds no data at all.", 4),
    (("fit", "run.xyz"), "run.xyz is of an unknown format: it has the suffix '.xyz'", 4),
    (("fit", "good.csv", "good.csv"), "good.csv is given twice: its samples would count twice.", 2),
    (("compare", "good.csv", "./other/../good.csv"), "good.csv is given twice", 2),
    (("map", "good.csv", "good.csv", *RIG), "good.csv is given twice", 2),
    (("energy", "good.csv", "good.csv", *RIG), "good.csv is given twice", 2),
    (("inspect", "god.csv"), "Did you mean 'good.csv'?", 4),
    (("compare", "god.csv"), "Did you mean 'good.csv'?", 4),
    (("map", "god.csv", *RIG), "Did you mean 'good.csv'?", 4),
    (("energy", "good.csv", "--no-contact", "god.csv", *RIG), "Did you mean 'good.csv'?", 4),
    (("calibrate", "ringdown", "god.csv"), "Did you mean 'good.csv'?", 4),
    (("calibrate", "frf", "god.csv"), "Did you mean 'good.csv'?", 4),
]
NAMES = [
    (("fit", "good.csv", "--friction", "stribek"), "There is no friction law 'stribek'. Did you mean 'stribeck'?", 2),
    (("fit", "good.csv", "--friction", "coulomb+"), "--friction 'coulomb+' has no law on one side of its +; write", 2),
    (("fit", "good.csv", "--friction", "coulomb+lugre"), "Coulomb + LuGre adds a set-valued law to one with", 2),
    (("fit", "good.csv", "--friction", "stribeck"), "Stribeck friction without mu_s is Coulomb's law", 2),
    (("fit", "good.csv", "--friction", "dahl", "--free", "mu,stiffness"), "Dahl friction needs sigma0: give it", 2),
    (("fit", "good.csv", "--free", "mu,dampng,stiffness"), "has no coefficient 'dampng'. Did you mean 'damping'?", 2),
    (("fit", "good.csv", "--fix", "v_s=1"), "This oscillator has no coefficient 'v_s'.", 2),
    (("fit", "good.csv", "--free", "mu,mu,stiffness"), "A parameter is named twice in --free mu,mu,stiffness.", 2),
    (("fit", "good.csv", "--free", "mu,mass,stiffness"), "mass and stiffness cannot both be free", 2),
    (("fit", "good.csv", "--bounds", "dampin=0:"), "Bounds are given for 'dampin', which is not a free parameter.", 2),
    (("fit", "good.csv", "--bounds", "damping=2:1"), "The bounds of damping must be a lower and a larger upper", 2),
    (("fit", "good.csv", "--guess", "my=1"), "Start values are given for 'my'", 2),
    (("fit", "good.csv", "--prior", "my=0.1(1)"), "Priors are given for 'my'", 2),
    (("fit", "good.csv", "--tie", "drag=my"), "Ties are given for 'my'", 2),
    (
        ("fit", "good.csv", "--tie", "mu=damping"),
        "mu is tied to damping and cannot be free as well. Take it out of --free.",
        2,
    ),
    (("fit", "good.csv", "--restoring", "pendlum"), "There is no restoring force 'pendlum'; known are linear,", 2),
    (("fit", "good.csv", "--restoring", "cubic"), "A cubic spring needs its coefficient: give k3", 2),
    (("fit", "good.csv", "--fix", "k3=1"), "k3 belongs to a cubic spring: give --restoring cubic with it", 2),
    (
        ("fit", "good.csv", "--engine", "exat"),
        "There is no engine 'exat'. Did you mean 'exact'? Choose one of auto",
        2,
    ),
    (("fit", "good.csv", "--start", "relese"), "There is no start 'relese'. Did you mean 'release'?", 2),
    (("fit", "good.csv", "--nuisance", "ofset"), "There is no nuisance parameter 'ofset'. Did you mean 'offset'?", 2),
    (("fit", "good.csv", "--nuisance", "x0,z0"), "this law has none. Leave it out of --nuisance.", 2),
    (("fit", "good.csv", "--sigma-mode", "scal"), "There is no sigma_mode 'scal'. Did you mean 'scale'?", 2),
    (("fit", "good.csv", "--loss", "hubr"), "There is no loss 'hubr'. Did you mean 'huber'?", 2),
    (("compare", "good.csv", "--friction", "coulom"), "There is no friction law 'coulom'. Did you mean 'coulomb'?", 2),
    (("compare", "good.csv", "--criterion", "held_out", "--no-held-out"), "with --no-held-out: leave it out,", 2),
    (("fit", "good.csv", "--friction", "spline"), "The law 'spline' is made in Python only, for its coefficients", 2),
    (("compare", "good.csv", "--criterion", "bci"), "There is no ranking by 'bci'. Did you mean 'bic'?", 2),
    (("compare", "good.csv", "--start", "relese"), "Did you mean 'release'?", 2),
    (("compare", "good.csv", "--friction", "dahl", "--friction", "dahl"), "are not all different", 2),
    (("map", "good.csv", *RIG, "--free", "my"), "This oscillator has no coefficient 'my'. Did you mean 'mu'?", 2),
    (("map", "good.csv", *RIG, "--start", "relese"), "Choose first_reversal or release.", 2),
    (("map", "good.csv"), "A map needs its rig to find mu: give --rig,", 2),
    (("energy", "good.csv"), "give --rig rig.toml.", 2),
    (("simulate", *RIG, "--x0", "1e-3"), "Coulomb friction needs mu: give it with --fix mu=...", 2),
    (("simulate", *RIG, "--x0", "1e-3", "--fix", "my=1,mu=1"), "This oscillator has no coefficient 'my'.", 2),
    (("check", *RIG, "--x0", "1e-3", "--free", "mu=0.01,my"), "This oscillator has no coefficient 'my'.", 2),
    (("check", *RIG, "--x0", "1e-3", "--fix", "mu=0.01", "--nuisance", "ofset"), "Did you mean 'offset'?", 2),
    (("calibrate", "ringdown", "good.csv", "--restoring", "cubc"), "Did you mean 'cubic'?", 2),
    (("models", "show", "lugr"), "There is no friction law 'lugr'. Did you mean 'lugre'?", 2),
]
NUMBERS = [
    (("fit", "good.csv", "--rig", "rg.toml"), "There is no rig file 'rg.toml'. Did you mean 'rig.toml'?", 2),
    (("fit", "good.csv", "--rig", "broken.toml"), "broken.toml: this is no valid TOML file", 2),
    (
        ("fit", "good.csv", "--rig", "key.toml"),
        "key.toml: there is no key 'mss' in a rig file. Did you mean 'mass'?",
        2,
    ),
    (
        ("energy", "good.csv", "--rig", "negative.toml"),
        "negative.toml: mass must be a positive number of kg, got -0.4.",
        2,
    ),
    (("fit", "good.csv", *RIG, "--mass", "-1"), "mass must be a positive number of kg, got -1.", 2),
    (("fit", "good.csv", *RIG, "--mass", "heavy"), 'mass = "heavy" is no quantity; write a number', 2),
    (("fit", "good.csv", "--mass", "1"), "give --normal-force and --mass.", 2),
    (("fit", "good.csv", "--row", "1"), "--row is no option for .csv files.", 2),
    (("inspect", "good.csv", "--rate", "-5", "--column", "1"), "rate must be a positive number of samples", 2),
    (("fit", "good.csv", "--rate", "5", "--time", "0"), "Give either --time (a column of times) or --rate", 2),
    (("fit", "good.csv", "--crop", "5:3"), "--crop '5:3' ends before it begins", 2),
    (("fit", "good.csv", "--crop", "5"), "--crop '5' is no span", 2),
    (("fit", "good.csv", "--fix", "mu=x"), "--fix mu must be a number, got 'x'.", 2),
    (("fit", "good.csv", "--prior", "mu=0.01"), "--prior mu needs a value with its standard deviation", 2),
    (("map", "good.csv", *RIG, "--mu-scatter", "2"), "mu_scatter is a relative standard deviation", 2),
    (("energy", "good.csv", *RIG, "--bins", "1"), "bins must be a whole number of at least 2", 2),
    (("simulate", *RIG, "--x0", "far", "--fix", "mu=0.1"), "--x0 must be a displacement such as 2e-3", 2),
    (("simulate", *RIG, "--x0", "1e-3", "--fix", "mu=0.1", "--rate", "-1"), "rate must be a positive number", 2),
    (("simulate", *RIG, "--x0", "1e-3", "--fix", "mu=0.1", "--noise", "-1"), "noise must not be negative", 2),
    (("simulate", *RIG, "--x0", "1e-3", "--fix", "mu=0.1", "--seed", "-1"), "seed must be a whole number", 2),
    (
        ("check", *RIG, "--x0", "1e-3", "--fix", "mu=0.1", "--noise", "1e-9", "--rate", "0"),
        "The rate must be a positive number",
        2,
    ),
    (("check", *RIG, "--x0", "1e-3", "--fix", "mu=0.1", "--noise", "0"), "The noise must be a positive standard", 2),
]
UNITS = [
    (("fit", "good.csv", "--unit", "s"), "The unit 's' does not fit the displacement", 4),
    (("inspect", "good.csv", "--time-unit", "mm"), "The unit 'mm' does not fit the time", 4),
    (("fit", "good.csv", "--unit", "kgg"), "'kgg' is not a known unit", 4),
    (("fit", "good.csv", *RIG, "--mass", "0.4 kgg"), "mass has the unknown unit 'kgg'; use for example 'kg'", 2),
    (("fit", "good.csv", *RIG, "--mass", "0,4"), "A decimal sign is a point here.", 2),
    (("fit", "good.csv", *RIG, "--mass", "0.4 N"), "The unit 'N' does not fit mass", 2),
    (("simulate", *RIG, "--x0", "2 kg", "--fix", "mu=0.1"), "The unit 'kg' does not fit --x0", 2),
]
CASES = [*PATHS, *NAMES, *NUMBERS, *UNITS]


@pytest.fixture(scope="module")
def refusals(tmp_path_factory):
    """Return exit code, sentence, stderr and loaded packages of each refusal."""
    folder = tmp_path_factory.mktemp("refusals")
    files = {
        "good.csv": "t,x\n" + "\n".join(f"{0.01 * i},{(-1) ** i}" for i in range(20)),
        "empty.csv": "",
        "run.xyz": "1 2 3",
        "rig.toml": "mass = 0.4107\nfrequency = 12.6\nnormal_force = 9.66\ndamping = 0\n",
        "broken.toml": "mass = \n",
        "key.toml": "mss = 1\n",
        "negative.toml": "mass = -0.4\nstiffness = 2574\nnormal_force = 9.66\n",
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "other").mkdir()
    commands = [words for words, *_ in CASES]
    done = subprocess.run(
        [sys.executable, "-c", _ALL], input=json.dumps(commands), cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return dict(zip(commands, json.loads(done.stdout), strict=True))


def test_refusals_say_what_is_wrong_before_any_large_import(refusals):
    def check(words, sentence, code):
        given, error, err, loaded = refusals[words]
        assert sentence in error
        assert (given, err, loaded) == (code, "", [])

    check_rows(check, CASES)


def test_no_refusal_speaks_python(refusals):
    python = {words: python_in(error) for words, (_, error, *_) in refusals.items()}
    assert not {words: found for words, found in python.items() if found}
