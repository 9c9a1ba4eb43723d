"""Compiled programs of a fit, and the engine of its numerical check."""

import re

import equinox as eqx
import numpy as np
import pytest

from fricjax import Measured, Oscillator, Rig, fit
from fricjax.estimation.loss import Squares
from fricjax.fitting import mesh, solve, stages
from fricjax.fitting.evaluation import evaluate
from fricjax.fitting.residual import without_inputs
from fricjax.friction import Coulomb, Stribeck
from fricjax.oscillator import Hybrid
from fricjax.oscillator.program import Shape, split
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, STIFFNESS, coulomb_run, noisy, oscillator

# Limit of the number of instructions that a fit compiles, before optimisation. It allows a margin of a tenth.
BUDGET = 9150
# Free parameters as in tests/fitting/test_recovery.py, so that both files share the compilation.
FREE = {"LuGre": (*MACHINE, "sigma0")}


def machine(law: str) -> Oscillator:
    if law != "Stribeck":
        return oscillator(RIGS["rolling"], law)
    rig = RIGS["rolling"]
    falling = Stribeck(rig.mu, mu_s=1.3 * rig.mu, v_stribeck=5e-3)
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, rig.load, falling)


def watched(monkeypatch) -> dict[str, dict[Shape, str]]:
    """Record the lowered programs of later fits by name and argument shapes."""
    programs: dict[str, dict[Shape, str]] = {}

    def watch(module, attribute: str, name: str) -> None:
        program = getattr(module, attribute)

        def lowered(args: tuple) -> None:
            shape, known = split(args)[0], programs.setdefault(name, {})
            if shape not in known:
                known[shape] = eqx.filter_jit(program.__wrapped__).lower(*args).as_text()

        class Watched:
            is_compiled = program.is_compiled

            def __call__(self, *args):
                lowered(args)
                return program(*args)

            def compile_beside(self, *args):
                lowered(args)

        monkeypatch.setattr(module, attribute, Watched())

    watch(solve, "staged", "stages")
    watch(mesh, "_meshes", "mesh")
    return programs


@pytest.mark.parametrize("law", ["Coulomb", "Tanh", "Stribeck"])
def test_a_fit_of_a_law_without_states_compiles_no_solver(law: str, monkeypatch):
    programs = watched(monkeypatch)
    run = noisy("rolling", "Coulomb" if law == "Stribeck" else law, 3)
    found = fit(run, machine(law), MACHINE, throw=False)
    assert found.engine == ("exact" if law == "Coulomb" else "tables")
    assert not programs


@pytest.mark.slow
def test_a_fit_and_its_check_are_one_program_of_bounded_size(monkeypatch):
    """Count programs and instructions of a fit of a law with states.

    Fit, check and continuation share one program. The mesh needs a separate one.
    """
    programs = watched(monkeypatch)
    assert fit(noisy("rolling", "LuGre", 3), machine("LuGre"), FREE["LuGre"], throw=False).passes > 2
    assert set(programs) == {"stages", "mesh"}
    texts = [text for shapes in programs.values() for text in shapes.values()]
    assert len(texts) == len(programs)
    instructions = [op for text in texts for op in re.findall(r"^ *%\S+ = (\S+)", text, re.MULTILINE)]
    assert sum(op != "stablehlo.constant" for op in instructions) < BUDGET


@pytest.mark.parametrize("samples", [3_000, 60_000, 250_000])
def test_a_record_and_its_condensation_share_a_program(samples: int):
    """Check that both have the same shapes.

    The fit uses the condensed record, and its check uses all samples. With different shapes, both would be compiled.
    """
    problem = problem_of(
        coulomb_run(samples=samples, rate=samples / 0.4), oscillator(RIGS["sliding"], "Coulomb"), MACHINE
    )
    assert split(problem.condensed)[0] == split(problem.residual)[0]


UNCERTAIN = Rig(
    mass=Measured(0.41, 1e-4), stiffness=Measured(2574.0, 2.0), normal_force=Measured(9.66, 0.05), damping=0.2
)


def test_a_mesh_is_the_same_program_with_a_rig():
    rig = Rig(mass=Measured(0.41, 1e-4), stiffness=2574.0, normal_force=Measured(1.89, 0.05), damping=0.17)
    law = machine("LuGre").friction
    alone, beside = (
        problem_of(noisy("rolling", "LuGre", 3), rig.oscillator(law), FREE["LuGre"], rig=each).residual
        for each in (None, rig)
    )
    assert beside.inputs.shape[0] == 2
    assert split(mesh._bare(alone))[0] == split(mesh._bare(beside))[0]


def test_inputs_of_a_rig_are_looked_at_by_a_small_program():
    """Compare instructions with and without inputs of a rig.

    The stages never move the inputs, so the solver does not include their coordinates.
    """
    problem = problem_of(coulomb_run(), UNCERTAIN.oscillator(Coulomb(0.05)), MACHINE, rig=UNCERTAIN)
    y = solve.start_coordinates(problem)

    def instructions(residual, at):
        member = solve.on_all_samples(problem, residual, at, stages.EVALUATE_ONLY)
        text = eqx.filter_jit(stages.solve_in_stages).lower(*member[:3], Squares(), *member[3:]).as_text()
        return text.count(" = stablehlo.")

    every = solve.with_inputs(problem.residual, y)
    assert every.size == y.size + 3
    assert instructions(problem.residual, every) < 0.75 * instructions(without_inputs(problem.residual), y)


@pytest.mark.slow
@pytest.mark.parametrize(("nodes", "amplitudes"), [(16, 24), (28, 6), (16, None)], ids=["nodes", "table", "no table"])
def test_the_check_tells_the_numerical_error_of_an_engine(nodes: int, amplitudes: int | None):
    """Compare the estimated numerical error with the true one.

    The estimate is the step to the optimum of another mesh of the same size, the truth that of a far finer mesh.
    """
    problem = problem_of(noisy("rolling", "Tanh", 5), machine("Tanh"), MACHINE, engine="hybrid")
    at = solve.solve_condensed(problem, solve.start_coordinates(problem))
    given = problem.residual.engine
    assert isinstance(given, Hybrid)

    def engine(nodes: int, amplitudes: int | None) -> Hybrid:
        span = given.span if amplitudes else None
        return Hybrid(nodes, given.max_half_cycles, span, amplitudes or 12, given.skew)

    def seen(engine: Hybrid):
        return evaluate(solve._with_engine(problem.residual, engine), at.y, Squares())

    own, checking, fine = map(seen, (engine(nodes, amplitudes), engine(nodes, amplitudes).checking(), engine(80, 64)))
    inverse = np.linalg.inv(np.asarray(fine.normal))

    def apart(a, b) -> float:
        change = a.gradient - b.gradient
        return float(np.sqrt(change @ inverse @ change))

    true, told = apart(own, fine), apart(own, checking)
    assert true > 0.01
    assert 0.3 < told / true < 8
