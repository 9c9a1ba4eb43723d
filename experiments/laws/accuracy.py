"""Compare the stated numerical error of random machines with the true one.

The machines have random coefficients around those of the standard motions of every law; one in four has no viscous
damping. The true error is the distance to a far finer integration. The table counts the machines with an error above
the requested accuracy, and those with an error of more than twice the stated one.

    python experiments/laws/accuracy.py [--machines 300] [--only Dahl LuGre]
"""

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from jax.tree_util import SequenceKey  # noqa: E402

import fricjax as fj  # noqa: E402
from experiments.laws.workloads import workloads  # noqa: E402
from fricjax.oscillator.engines.base import AbstractEngine  # noqa: E402
from fricjax.oscillator.select import select_engine  # noqa: E402

ACCURACY = 1e-10
# Largest change of the logarithm of a coefficient of the machine and of its law.
_MACHINE, _LAW = np.log(2), np.log(1.2)


def drawn(friction: fj.friction.AbstractFriction, load: float, random: np.random.Generator) -> fj.Oscillator:
    """Draw a machine with valid coefficients."""
    while True:
        leaves, structure = jax.tree_util.tree_flatten_with_path(friction)
        # The values of a list have one factor: random forces at the knots of a spline would be no friction curve.
        fields = [tuple(key for key in path if not isinstance(key, SequenceKey)) for path, _ in leaves]
        factors = {field: np.exp(random.uniform(-_LAW, _LAW)) for field in dict.fromkeys(fields)}
        changed = [np.asarray(leaf * factors[field]) for (_, leaf), field in zip(leaves, fields, strict=True)]
        mass, stiffness, damping, force = np.array([0.41068, 2574.0, 0.17557, load]) * np.exp(
            random.uniform(-_MACHINE, _MACHINE, 4)
        )
        law = jax.tree.unflatten(structure, changed)
        try:
            return fj.Oscillator(mass, stiffness, damping * (random.random() > 0.25), force, law)
        except ValueError:
            continue


def reference(oscillator: fj.Oscillator) -> AbstractEngine:
    """Return an engine with a far smaller error."""
    engine = select_engine("auto", oscillator, accuracy=ACCURACY)
    return engine.finer().finer().finer()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=300)
    parser.add_argument("--only", nargs="+", help="laws")
    options = parser.parse_args(arguments)
    fj.progress(False)
    warnings.simplefilter("ignore", UserWarning)
    random = np.random.default_rng(0)
    chosen = [each for each in workloads() if options.only is None or each.law in options.only]
    ts = np.linspace(0.0, 0.5, 501)
    total = missed = wrong = 0
    print("law                    motions  largest error [nm]  above accuracy  above twice the stated error")
    for i, each in enumerate(chosen):
        errors, stated = [], []
        for _ in range(options.machines * (i + 1) // len(chosen) - options.machines * i // len(chosen)):
            machine = drawn(each.friction, each.run.load, random)
            x0 = 2e-3 * np.exp(random.uniform(-_MACHINE, _MACHINE))
            motion = fj.simulate(machine, x0, ts, accuracy=ACCURACY, error=True)
            fine = fj.simulate(machine, x0, ts, engine=reference(machine))
            errors.append(float(np.max(np.abs(motion.x - fine.x))))
            stated.append(float(np.asarray(motion.error)))
        # A motion that failed counts as a miss.
        above, off = ~(np.array(errors) <= ACCURACY), ~(np.array(errors) <= 2 * np.array(stated))
        total, missed, wrong = total + len(errors), missed + int(above.sum()), wrong + int(off.sum())
        print(f"{each.law:<22} {len(errors):7} {1e9 * max(errors):19.3g} {above.sum():15} {off.sum():29}", flush=True)
    print(f"{missed} of {total} machines above the accuracy, {wrong} above twice the stated error")


if __name__ == "__main__":
    main()
