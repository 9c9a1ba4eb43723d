"""Rig: oscillator, file, error messages, and derivatives in the calibrated values."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.errors import UsageError
from fricjax.friction import Coulomb
from fricjax.oscillator import Oscillator
from fricjax.oscillator.restoring import Cubic, Linear, Pendulum
from fricjax.rig import Measured, Rig
from tests.helpers import largest

LAW = Coulomb(0.01)


def uncertain_rig(**changes) -> Rig:
    given = {
        "mass": Measured(0.41, 0.001),
        "frequency": Measured(12.6, 0.01),
        "damping_ratio": Measured(0.0027, 0.0001),
        "normal_force": Measured(1.89, 0.01),
        "restoring": "cubic",
        "k3": Measured(1e7, 1e5),
        "drag": Measured(0.3, 0.01),
    }
    return Rig(**{**given, **changes})


def test_oscillator_of_a_stiffness_and_a_damping():
    oscillator = Rig(mass=0.4, stiffness=2574, damping=0.2, normal_force=1.89, drag=0.5).oscillator(LAW)
    got = [oscillator.mass, oscillator.stiffness, oscillator.damping, oscillator.normal_force, oscillator.drag]
    assert [float(value) for value in got] == [0.4, 2574.0, 0.2, 1.89, 0.5]
    assert isinstance(oscillator.restoring, Linear)


def test_frequency_and_damping_ratio_stand_for_stiffness_and_damping():
    oscillator = uncertain_rig().oscillator(LAW)
    assert float(oscillator.stiffness) == pytest.approx(0.41 * (2 * math.pi * 12.6) ** 2, rel=1e-14)
    assert float(oscillator.damping_ratio) == pytest.approx(0.0027, rel=1e-14)


def test_unknown_damping_starts_at_zero():
    assert float(Rig(mass=1, stiffness=1, normal_force=1).oscillator(LAW).damping) == 0.0


@pytest.mark.parametrize(
    ("given", "k3", "kind"),
    [("pendulum", None, Pendulum), (Pendulum(), None, Pendulum), (Cubic(5.0), None, Cubic), ("cubic", 5.0, Cubic)],
)
def test_restoring_force_by_name_or_instance(given, k3, kind):
    oscillator = Rig(mass=1, stiffness=1, normal_force=1, restoring=given, k3=k3).oscillator(LAW)
    assert isinstance(oscillator.restoring, kind)
    assert not isinstance(oscillator.restoring, Cubic) or float(oscillator.restoring.k3) == 5.0


def test_inputs_are_the_uncertain_values():
    rig = uncertain_rig(drag=0.3)
    assert list(rig.inputs()) == ["mass", "frequency", "damping_ratio", "normal_force", "k3"]
    assert rig.inputs()["mass"] == Measured(0.41, 0.001)


def test_derivatives_with_respect_to_every_input():
    rig = uncertain_rig()

    def leaves(values):
        return jnp.stack(jax.tree.leaves(rig.with_inputs(values).oscillator(LAW)))

    start = {name: value.value for name, value in rig.inputs().items()}
    assert set(start) == {"mass", "frequency", "damping_ratio", "normal_force", "k3", "drag"}
    jacobian = jax.jacfwd(leaves)(start)
    for name, value in start.items():
        step = 1e-4 * value
        difference = (leaves({**start, name: value + step}) - leaves({**start, name: value - step})) / (2 * step)
        np.testing.assert_allclose(jacobian[name], difference, rtol=1e-7, atol=1e-7)
        assert np.linalg.norm(difference) > 0


def test_directional_derivative_reaches_the_dead_band():
    rig = uncertain_rig()
    load = rig.normal_force.value

    def dead_band(value):
        return rig.with_inputs({"normal_force": value}).oscillator(LAW).dead_band

    band, slope = jax.jvp(dead_band, (load,), (1.0,))
    assert float(slope) == pytest.approx(float(band) / load, rel=1e-12)


def test_mass_moves_the_stiffness_of_a_rig_given_by_its_frequency():
    rig = uncertain_rig()
    slope = jax.grad(lambda mass: rig.with_inputs({"mass": mass}).oscillator(LAW).stiffness)(0.41)
    assert float(slope) == pytest.approx((2 * math.pi * 12.6) ** 2, rel=1e-12)


def test_replace_exchanges_frequency_for_stiffness_and_keeps_the_rest():
    rig = uncertain_rig().replace(stiffness="2.6 N/mm", damping=0.1)
    assert (rig.frequency, rig.damping_ratio) == (None, None)
    assert rig.stiffness == Measured(2600.0)
    assert rig.mass == Measured(0.41, 0.001)
    assert isinstance(rig.replace(restoring="pendulum").restoring, Pendulum)
    assert rig.replace(restoring=Cubic(3.0)).k3 == Measured(3.0)


READING = {
    "displacement_scale": Measured(1.0, 2e-6),
    "time_scale": Measured(1.0, 1e-6),
    "periodic_nonlinearity": Measured(0.0, 2e-9),
}


def test_errors_of_the_reading_are_inputs_that_leave_the_machine_alone():
    rig, plain = uncertain_rig(**READING), uncertain_rig()
    assert rig.nonlinearity_period == Measured(633e-9 / 2)
    assert plain.nonlinearity_period is None
    assert rig.inputs() == {**plain.inputs(), **READING}
    assert jax.tree.leaves(rig.oscillator(LAW)) == jax.tree.leaves(plain.oscillator(LAW))
    assert rig.replace(periodic_nonlinearity=None).numbers().keys() == {*plain.numbers(), *list(READING)[:2]}
    double_pass = uncertain_rig(**READING, nonlinearity_period="158.25 nm")
    assert double_pass.numbers()["nonlinearity_period"].value == pytest.approx(158.25e-9)


def test_shifted_moves_one_input_after_the_other():
    moved = list(uncertain_rig(**READING).shifted())
    machine = uncertain_rig().inputs()
    assert [scale for _, scale in moved] == [*[1.0] * len(machine), 1 + 2e-6]
    for (rig, _), (name, number) in zip(moved, machine.items(), strict=False):
        assert rig.numbers()[name].value == number.value + number.std
        assert [other for other in machine if rig.numbers()[other].value != machine[other].value] == [name]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (
            {"displacement_scale": 1.00002},
            "displacement_scale must be 1, got 1.00002: multiply the displacements of the",
        ),
        ({"time_scale": 0.5}, "time_scale must be 1, got 0.5: multiply the times of the record by it, and give its"),
        (
            {"periodic_nonlinearity": 5e-9},
            "periodic_nonlinearity must be 0, got 5e-09: give its standard uncertainty al",
        ),
        ({"nonlinearity_period": 316.5e-9}, "nonlinearity_period belongs to a periodic_nonlinearity: give both, or le"),
        ({**READING, "nonlinearity_period": 0.0}, "nonlinearity_period must be a positive number of m, got 0."),
    ],
)
def test_refused_errors_of_the_reading(given, sentence):
    with pytest.raises(UsageError) as caught:
        uncertain_rig(**given)
    assert str(caught.value).startswith(sentence)


def test_a_rotary_rig_has_no_fringe_of_its_own():
    pendulum = {"restoring": "pendulum", "k3": None, **READING}
    with pytest.raises(UsageError, match=r"of a rotary rig needs its period: give nonlinearity_period \[rad\]"):
        uncertain_rig(**pendulum)
    assert uncertain_rig(**pendulum, nonlinearity_period=1e-3).nonlinearity_period == Measured(1e-3)


def test_errors_of_the_reading_in_a_file(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        'mass = 0.4\nstiffness = 2574\nnormal_force = 1.89\ndisplacement_scale = { value = 1, std = "0.001 %" }\n'
        'time_scale = "1 +/- 2e-6"\nperiodic_nonlinearity = { value = 0, std = 3.5, unit = "nm" }\n'
    )
    rig = Rig.from_toml(path)
    assert (rig.displacement_scale, rig.time_scale) == (Measured(1.0, 1e-5), Measured(1.0, 2e-6))
    assert rig.periodic_nonlinearity is not None
    assert rig.periodic_nonlinearity.std == pytest.approx(3.5e-9)
    rig.to_toml(path, overwrite=True)
    assert Rig.from_toml(path) == rig
    assert "inf" not in rig.summary()


def test_file_round_trip(tmp_path):
    rig = uncertain_rig()
    rig.to_toml(tmp_path / "rig.toml")
    assert Rig.from_toml(tmp_path / "rig.toml") == rig
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]


def test_a_good_rig_goes_only_where_it_may_and_where_there_is_space(tmp_path):
    path = uncertain_rig().to_toml(tmp_path / "rig.toml")
    before = path.read_text()
    with pytest.raises(FileExistsError, match="give overwrite=True"):
        uncertain_rig(mass=1.0).to_toml(path)
    with largest(50), pytest.raises(OSError, match="no space left"):
        uncertain_rig(mass=1.0).to_toml(path, overwrite=True)
    assert [each.read_text() for each in tmp_path.iterdir()] == [before]


def test_file_with_units(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        'mass = { value = 410.7, std = 0.3, unit = "g" }\nfrequency = "12.600(2) Hz"\n'
        'normal_force = { value = 9.66, std = "0.5 %" }\nrestoring = "linear"\n'
    )
    rig = Rig.from_toml(path)
    assert rig.mass.value == pytest.approx(0.4107)
    assert rig.mass.std == pytest.approx(3e-4)
    assert rig.frequency == Measured(12.6, 0.002)
    assert rig.normal_force.std == pytest.approx(0.0483)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("mass = -0.4", "mass must be a positive number of kg, got -0.4."),
        ("massa = 0.4", "there is no key 'massa' in a rig file. Did you mean 'mass'? Known are mass, "),
        ("mass = 0.4\nmass = 0.5", "this is no valid TOML file:"),
        ('mass = { value = 0.4, unit = "mm" }', "The unit 'mm' does not fit mass;"),
        ("normal_force = -1", "normal_force must not be negative, got -1 N."),
        ("frequency = 12.6", "give one of them, got both."),
        ('restoring = "pendelum"', "Did you mean 'pendulum'?"),
        ("k3 = 1e6", "k3 belongs to a cubic spring"),
        ('restoring = "cubic"', "A cubic spring needs its coefficient: give k3 [N/m^3]."),
        ("damping = 0.1\ndamping_ratio = 0.01", "A rig has a damping [N s/m] or a damping_ratio [1]: give one of them"),
    ],
)
def test_file_refusals_name_file_key_and_value(tmp_path, text, sentence):
    path = tmp_path / "rig.toml"
    lines = {"mass": "mass = 0.4", "stiffness": "stiffness = 2574", "normal_force": "normal_force = 1.89"}
    path.write_text("\n".join([text, *(line for key, line in lines.items() if f"{key} =" not in text)]))
    with pytest.raises(UsageError) as caught:
        Rig.from_toml(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert sentence in str(caught.value)


def test_missing_file_and_missing_key(tmp_path):
    with pytest.raises(UsageError, match="There is no rig file"):
        Rig.from_toml(tmp_path / "none.toml")
    (tmp_path / "rig.toml").write_text("mass = 1\nstiffness = 1\n")
    with pytest.raises(UsageError, match="'normal_force' is missing; add a line such as"):
        Rig.from_toml(tmp_path / "rig.toml")


def test_unknown_names_offer_the_nearest():
    rig = uncertain_rig()
    with pytest.raises(UsageError, match=r"The rig has no value 'normal_forc'; .* Did you mean 'normal_force'\?"):
        rig.with_inputs({"normal_forc": 1.0})
    with pytest.raises(UsageError, match=r"A rig has no 'masss'; .* Did you mean 'mass'\?"):
        rig.replace(masss=1.0)
    with pytest.raises(UsageError, match="got neither"):
        Rig(mass=1, normal_force=1)


def test_summary_shows_units_and_relative_uncertainty():
    text = uncertain_rig().summary()
    assert "0.4100(10)" in text
    assert "N s^2/m^2" in text
    assert "0.53 %" in text
    assert "<table>" in uncertain_rig()._repr_html_()


def test_plain_data_and_a_data_frame_hold_all_digits():
    rig = uncertain_rig(drag=0.3)
    data = rig.to_dict()
    assert data["mass"] == {"value": 0.41, "std": 0.001}
    assert data["restoring"] == "cubic"
    frame = rig.to_dataframe().set_index("quantity")
    assert frame.loc["k3", "value"] == 1e7
    assert frame.loc["k3", "std"] == 1e5
    assert frame.loc["drag", "relative_std"] == 0
    pendulum = Rig(mass=1, stiffness=1, normal_force=1, restoring="pendulum").to_dataframe()
    assert list(pendulum["unit"]) == ["kg m^2", "N m/rad", "N m", "N m s^2/rad^2"]


def test_oscillator_is_an_oscillator_of_numbers():
    oscillator = uncertain_rig().oscillator(LAW)
    assert isinstance(oscillator, Oscillator)
    assert all(isinstance(leaf, np.ndarray) for leaf in jax.tree.leaves(oscillator))
