"""Streamed pass over all samples against the dense Jacobian of the residual."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax import Measured, Oscillator, Rig
from fricjax.estimation.loss import Cauchy, Huber, Squares
from fricjax.estimation.passes import Pass
from fricjax.fitting import evaluation as module
from fricjax.fitting.evaluation import Evaluation
from fricjax.fitting.mesh import with_mesh
from fricjax.friction import Coulomb, Tanh
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import FREQUENCY, MACHINE, STIFFNESS, coulomb_run

pytestmark = pytest.mark.slow

PRIORS = {"damping": (0.18, 1e-3), "offset": (1e-6, 1e-7)}
RIG = Rig(mass=Measured(PROTOTYPE_MASS, 1e-3), frequency=Measured(FREQUENCY, 1e-5), normal_force=Measured(9.66, 0.05))


def machine(law):
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, law)


def problem(engine: str):
    """Return a problem with one run and priors.

    The problem of the exact engine also has a rig.
    """
    if engine == "exact":
        return problem_of(coulomb_run(), RIG.oscillator(Coulomb(0.05)), ("mu", "damping"), priors=PRIORS, rig=RIG)
    law = Coulomb(0.05) if engine == "hybrid" else Tanh(0.05, 1e-2)
    return problem_of(coulomb_run(), machine(law), MACHINE, priors=PRIORS, engine=engine)


def cut(residual):
    """Remove the padding samples of zero weight."""
    run = residual.runs[0]
    columns = tuple(values[run.weight > 0] for values in (run.t, run.x, run.weight))
    return eqx.tree_at(lambda r: (r.runs[0].t, r.runs[0].x, r.runs[0].weight), residual, columns)


@eqx.filter_jit
def whole(residual, y):
    return residual(y), jax.jacfwd(residual)(y)


def dense(residual, y, loss) -> Evaluation:
    """Evaluate from the whole Jacobian, with squared priors for every loss."""
    r, jacobian = (np.asarray(part) for part in whole(residual, y))
    rows = r.size - residual.n_parameters
    priors = r[rows:] ** 2, np.ones(r.size - rows), np.ones(r.size - rows)
    rho, weight, curvature = (np.r_[np.asarray(a), b] for a, b in zip(loss.parts(r[:rows]), priors, strict=True))
    ends = np.cumsum([0, *(run.t.size for run in residual.runs)])
    total, *runs = (
        Pass(
            np.sum(rho[part]) / 2,
            jacobian[part].T @ (weight * r)[part],
            jacobian[part].T @ (curvature[:, None] * jacobian)[part],
        )
        for part in (slice(None), *(slice(*pair) for pair in itertools.pairwise(ends)))
    )
    return Evaluation(r, r @ r, total.cost, total.gradient, total.normal, runs, [], [])


def streamed(residual, y, loss, monkeypatch, chunk) -> Evaluation:
    """Evaluate in chunks of a given length.

    Each call compiles, because the length is not an argument of the program.
    """
    monkeypatch.setattr(module, "CHUNK", chunk)
    return eqx.filter_jit(module.evaluate.__wrapped__)(residual, y, loss)


def assert_same(residual, found: Evaluation, expected: Evaluation):
    unit = np.sqrt(np.diag(expected.normal))
    # The residual is the difference of two numbers of this size, each with an error of some units in the last place.
    size = max(float(np.max(np.abs(run.weight * run.x))) for run in residual.runs)
    assert found.residual == pytest.approx(expected.residual, rel=1e-12, abs=1e-14 * size)
    rounding = 2e-14 * size * float(np.sum(np.abs(expected.residual)))
    assert float(found.chi2) == pytest.approx(float(expected.chi2), rel=1e-12, abs=rounding)
    assert float(found.cost) == pytest.approx(float(expected.cost), rel=1e-12, abs=rounding)
    assert found.gradient / unit == pytest.approx(expected.gradient / unit, abs=1e-10 * np.sqrt(expected.chi2))
    scale = np.outer(unit, unit)
    assert found.normal / scale == pytest.approx(expected.normal / scale, abs=1e-10)
    for one, other in zip(found.runs, expected.runs, strict=True):
        assert float(one.cost) == pytest.approx(float(other.cost), rel=1e-12, abs=rounding)
        assert one.gradient / unit == pytest.approx(other.gradient / unit, abs=1e-10 * np.sqrt(expected.chi2))
        assert one.normal / scale == pytest.approx(other.normal / scale, abs=1e-10)


@pytest.mark.parametrize("engine", ["exact", "hybrid", "smooth"])
def test_the_sums_are_those_of_the_dense_jacobian(engine, monkeypatch):
    """Sum in chunks, of which the last is not full.

    Far from the optimum, no part of the gradient cancels.
    """
    residual = cut(problem(engine).residual)
    samples = residual.runs[0].t.size
    assert samples % -(-samples // 300) > 0
    p, inputs = residual.n_parameters, residual.inputs.shape[0]
    assert inputs == (3 if engine == "exact" else 0)
    y = jnp.asarray(np.r_[1e-4 * (1 + np.arange(p)), np.zeros(inputs)])
    residual = with_mesh(residual, y)
    expected = dense(residual, y, Squares())
    assert np.all(np.diag(expected.normal) > 0)
    assert_same(residual, streamed(residual, y, Squares(), monkeypatch, 300), expected)


@pytest.mark.parametrize("loss", [Squares(), Huber(), Cauchy()], ids=lambda loss: type(loss).__name__)
def test_each_sample_is_weighted_as_its_loss_says_and_priors_are_not(loss, monkeypatch):
    residual = problem("exact").residual
    y = jnp.asarray(np.r_[1e-7 * np.ones(residual.n_parameters), np.zeros(3)])
    assert_same(residual, streamed(residual, y, loss, monkeypatch, 16384), dense(residual, y, loss))


@pytest.mark.parametrize(
    "free, settings",
    [
        (MACHINE, {}),
        (("mu", "damping"), {"rig": RIG}),
        # The machine of each run follows a parameter of the first one.
        (("mu", "stiffness"), {"tie": {"damping": ("x0[0]", 50.0)}}),
    ],
    ids=["as they are", "with a rig", "with a tie to one run"],
)
def test_several_runs_add_up(free, settings, monkeypatch):
    """Sum over runs that depend on different parameters."""
    records = [coulomb_run(), coulomb_run(2.5e-3, seed=5)]
    law = RIG.oscillator(Coulomb(0.05)) if "rig" in settings else machine(Coulomb(0.05))
    both = problem_of(records, law, free, **settings).residual
    y = jnp.asarray(np.r_[1e-5 * np.ones(both.n_parameters), np.zeros(both.inputs.shape[0])])
    assert_same(both, streamed(both, y, Squares(), monkeypatch, 900), dense(both, y, Squares()))


def test_more_samples_than_one_chunk_holds():
    residual = problem_of(coulomb_run(samples=20_000, rate=5e4), machine(Coulomb(0.05)), MACHINE).residual
    assert residual.runs[0].t.size > module.CHUNK
    y = 1e-5 * jnp.ones(residual.n_parameters)
    assert_same(residual, module.evaluate(residual, y, Squares()), dense(residual, y, Squares()))


@pytest.mark.parametrize("loss", [Squares(), Huber()], ids=lambda loss: type(loss).__name__)
def test_blocks_of_samples_add_up_to_the_whole(loss):
    """Use blocks of four samples."""
    residual = problem_of(coulomb_run(samples=20_000, rate=5e4), machine(Coulomb(0.05)), MACHINE).residual
    y = 1e-5 * jnp.ones(residual.n_parameters)
    blocks, run = module.Block.of(module.evaluate(residual, y, loss).blocks[0]), residual.runs[0]
    assert module.block_length(run.t.size) == 4 and blocks.used.size == run.t.size // 4
    r, jacobian = (np.asarray(part)[: run.t.size] for part in whole(residual, y))
    _, weight, curvature = (np.asarray(part) for part in loss.parts(r))
    used = run.weight > 0
    expected = {
        "residual": weight * r, "square": (weight * r) ** 2, "used": used, "curvature": used * curvature,
        "slopes": (used * curvature)[:, None] * jacobian,
    }  # fmt: skip
    for name, each in expected.items():
        four = each.reshape(-1, 4, *each.shape[1:]).sum(axis=1)
        assert getattr(blocks, name) == pytest.approx(four, rel=1e-6, abs=1e-6 * np.max(np.abs(four))), name
    # The pass takes no differences across chunks.
    place = np.arange(r.size) % module.CHUNK
    bend = np.convolve(weight * r, [1, -2, 1], "same") * (place > 0) * (place < module.CHUNK - 1)
    step = np.diff(r + run.weight * run.x, prepend=0.0) * (place > 0)
    either = used & np.roll(used, 1)
    for name, each in {"rough": either * np.roll(used, -1) * bend**2 / 6, "moved": either * step**2}.items():
        four = each.reshape(-1, 4).sum(axis=1)
        assert getattr(blocks, name) == pytest.approx(four, rel=1e-6, abs=1e-6 * np.max(four)), name
