"""Oscillator and free coefficients from command-line options."""

import math

import pytest

from fricjax.cli.options import Machine
from fricjax.data.read import example_paths
from fricjax.errors import UsageError
from fricjax.friction import Coulomb, LuGre, QuadraticDrag, Stribeck, Sum, Tanh
from fricjax.machine.choose import choose, known
from fricjax.machine.laws import laws
from fricjax.oscillator.restoring import Cubic, Pendulum
from tests.helpers import EXPORTED_LAWS

RIG = example_paths().rig


def test_every_law_has_its_name():
    without_numbers = {
        "GeneralisedMaxwellSlip",
        "Leuven",
        "MaxwellSlip",
        "MonotoneSpline",
        "Spline",
        "Sum",
    }
    assert set(laws()) == {name.lower() for name in EXPORTED_LAWS.keys() - without_numbers}


def test_without_a_rig_the_machine_is_normalised():
    choice = choose(Machine())
    assert choice.rig is None
    assert choice.free == ("mu", "damping", "stiffness")
    assert (float(choice.oscillator.mass), float(choice.oscillator.normal_force)) == (1.0, 1.0)


def test_with_a_rig_its_values_are_used():
    choice = choose(Machine(rig=RIG))
    assert choice.rig is not None
    assert float(choice.oscillator.mass) == pytest.approx(0.4107)
    assert float(choice.oscillator.stiffness) == pytest.approx(0.4107 * (2 * math.pi * 12.6) ** 2)


def test_options_override_the_rig():
    choice = choose(
        Machine(rig=RIG, mass="500 g", normal_force="2(1) N", restoring="pendulum", drag=0.3, fix=["damping=0.1"])
    )
    machine = choice.oscillator
    assert [float(v) for v in (machine.mass, machine.normal_force, machine.drag, machine.damping)] == [
        0.5,
        2.0,
        0.3,
        0.1,
    ]
    assert isinstance(machine.restoring, Pendulum)
    assert choice.rig is not None
    assert choice.rig.inputs()["normal_force"].std == 1.0
    assert choice.free == ("mu", "stiffness")


def test_load_and_mass_are_enough_and_so_are_load_and_stiffness():
    by_mass = choose(Machine(mass="0.41", normal_force="9.66"))
    assert by_mass.free == ("mu", "damping", "stiffness")
    assert by_mass.rig is not None
    by_stiffness = choose(Machine(stiffness="2574", normal_force="9.66"))
    assert by_stiffness.free == ("mu", "damping", "mass")
    assert float(by_stiffness.oscillator.stiffness) == 2574.0


def test_laws_and_their_coefficients():
    law = choose(Machine(friction="tanh", fix=["v_s=1e-5"])).oscillator.friction
    assert isinstance(law, Tanh)
    assert float(law.v_s) == 1e-5
    law = choose(Machine(friction="stribeck", fix=["v_stribeck=5e-3"]), "mu,mu_s=0.03,stiffness").oscillator.friction
    assert isinstance(law, Stribeck)
    assert law.mu_s is not None
    assert (float(law.mu_s), float(law.v_stribeck)) == (0.03, 5e-3)
    law = choose(Machine(friction="lugre", fix=["sigma0=2e5,sigma1=100"])).oscillator.friction
    assert isinstance(law, LuGre)
    assert (float(law.sigma0), float(law.sigma1), law.mu_s) == (2e5, 100.0, None)


def test_sums_of_laws_take_dotted_names():
    law = choose(
        Machine(friction="coulomb+quadraticdrag", fix=["friction.0.mu=0.03", "quadratic_drag=0.2"]), "stiffness"
    ).oscillator.friction
    assert isinstance(law, Sum)
    first, second = law.laws
    assert isinstance(first, Coulomb)
    assert isinstance(second, QuadraticDrag)
    assert (float(first.mu), float(second.quadratic_drag)) == (0.03, 0.2)


def test_a_static_coefficient_exists_where_it_is_mentioned():
    assert choose(Machine(), "mu,mu_s,stiffness").oscillator.friction.mu_s is not None  # type: ignore[attr-defined]
    assert choose(Machine(), tied=("mu_s",)).oscillator.friction.mu_s is not None  # type: ignore[attr-defined]
    assert choose(Machine()).oscillator.friction.mu_s is None  # type: ignore[attr-defined]


def test_cubic_spring():
    machine = choose(Machine(rig=RIG, restoring="cubic", fix=["k3=1e6"])).oscillator
    assert isinstance(machine.restoring, Cubic)
    assert float(machine.restoring.k3) == 1e6


@pytest.mark.parametrize(
    ("options", "free", "sentence"),
    [
        (Machine(friction="colomb"), None, "There is no friction law 'colomb'. Did you mean 'coulomb'?"),
        (Machine(fix=["vs=1"], friction="tanh"), None, "has no coefficient 'vs'"),
        (Machine(fix=["mu=x"]), None, "--fix mu must be a number, got 'x'."),
        (Machine(fix=["mu=0.1"]), "mu,stiffness", "mu is both fixed and free."),
        (Machine(), "mu,dampng,stiffness", "Did you mean 'damping'?"),
        (Machine(), "mu", "Without a rig the stiffness must be free"),
        (Machine(), "muu", "This oscillator has no coefficient 'muu'. Did you mean 'mu'?"),
        (Machine(stiffness="1", normal_force="1"), "mu", "Without its mass the mass must be free"),
        (Machine(mass="1"), None, "give --normal-force and --mass"),
        (Machine(normal_force="1"), None, "give --normal-force and --mass"),
        (Machine(rig=RIG, mass="-1"), None, "mass must be a positive number of kg, got -1."),
        (Machine(rig=RIG, mass="1 N"), None, "The unit 'N' does not fit mass;"),
        (Machine(friction="stribeck"), None, "Stribeck friction without mu_s is Coulomb's law"),
        (Machine(friction="coulomb+lugre"), None, "adds a set-valued law to one with internal states"),
        (
            Machine(friction="coulomb+coulomb"),
            "mu,stiffness",
            "'mu' is ambiguous here: say which one, friction.0.mu or",
        ),
    ],
)
def test_refusals_by_their_text(options, free, sentence):
    with pytest.raises(UsageError) as caught:
        choose(options, free)
    assert sentence in str(caught.value)


def test_a_simulation_needs_every_coefficient():
    assert float(known(Machine(rig=RIG, fix=["mu=0.02"])).oscillator.friction.mu) == 0.02  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match="Coulomb friction needs mu: give it with --fix mu="):
        known(Machine(rig=RIG))
    with pytest.raises(UsageError, match="A simulation needs the machine"):
        known(Machine(fix=["mu=0.02"]))
