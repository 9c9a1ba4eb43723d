"""Time the first fits of a fresh process, before and after compilation.

Under each law three runs, released at 1, 2 and 3 mm, are fitted one after the other. For some laws only the first fit
counts. The runs are then fitted as a batch, and compared under four laws. If FRICJAX_DATA names the folder of the
measured pendulums, one of them is fitted from the command line. Each job runs in two processes: the first finds an
empty folder of compiled programs, the second finds the programs that the first has stored. The script prints the
seconds of the import and of each fit, the number of programs that each fit compiled or loaded, and the seconds that JAX
spent on tracing and compiling. Run nothing else at the same time.

    python experiments/benchmarks/cold.py [--only tanh,lugre] [--json FILE]
"""

import argparse
import compileall
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

RELEASES, RATE, DURATION = (1e-3, 2e-3, 3e-3), 5e3, 2.0
MACHINE = ("mu", "damping", "stiffness")
# Largest total seconds of a job with an empty and with a filled cache. None: no limit.
LAWS = {"coulomb": (2.0, 2.0), "tanh": (2.0, 2.0), "stribeck": (2.5, 2.5), "lugre": (12.0, 3.0), "dahl": (12.0, 3.0)}
# The other laws with large programs. Only the first fit counts. Elements come in pairs.
OTHERS = ("maxwell-slip", "elasto-plastic", "rate-state", "bliman-sorine", "gms", "leuven")
ASKED = {
    **LAWS,
    **dict.fromkeys(OTHERS, (20.0, None)),
    "batch": (8.0, None),
    "compare": (30.0, None),
    "pendulum": (12.0, 4.0),
}
PENDULUM = "multiarm-pendulum/SinglePendulumDataForParameterEstimation.mat"
COMMAND = (
    "--column Y_id --column Y_vad --time Time_id --time Time_vad --unit rad --restoring pendulum "
    "--free mu,damping,stiffness,drag"
)


def machine(law: str) -> Any:
    import rig

    import fricjax as fj

    stiffnesses = (0.6 * rig.SIGMA0, 0.4 * rig.SIGMA0)
    laws: dict[str, Any] = {
        "coulomb": lambda: fj.friction.Coulomb(rig.MU),
        "tanh": lambda: fj.friction.Tanh(rig.MU, rig.V_S),
        "stribeck": lambda: fj.friction.Stribeck(rig.MU, mu_s=1.3 * rig.MU, v_stribeck=5e-3),
        "lugre": lambda: fj.friction.LuGre(rig.MU, sigma0=rig.SIGMA0, sigma1=rig.SIGMA1),
        "dahl": lambda: fj.friction.Dahl(rig.MU, sigma0=rig.SIGMA0),
        "maxwell-slip": lambda: fj.friction.MaxwellSlip(stiffnesses, (0.4 * rig.MU, 0.6 * rig.MU)),
        "elasto-plastic": lambda: fj.friction.ElastoPlastic(rig.MU, sigma0=rig.SIGMA0, sigma1=rig.SIGMA1),
        "rate-state": lambda: fj.friction.RateState(rig.MU, a=0.04 * rig.MU, b=0.02 * rig.MU, slip_distance=1e-5),
        "bliman-sorine": lambda: fj.friction.BlimanSorine(1.4 * rig.MU, 0.4 * rig.MU, 0.3, 1e-4),
        "gms": lambda: fj.friction.GeneralisedMaxwellSlip(rig.MU, 1.2 * rig.MU, 0.02, stiffnesses, (0.4,), 50.0),
        "leuven": lambda: fj.friction.Leuven(rig.MU, 1.2 * rig.MU, 0.02, stiffnesses, (0.4,), sigma1=rig.SIGMA1),
    }
    return fj.Oscillator(rig.MASS, rig.STIFFNESS, rig.DAMPING, rig.LOAD, laws[law]())


def free(law: str) -> tuple[str, ...]:
    if law in ("maxwell-slip", "bliman-sorine"):  # these laws have other names for the coefficients
        return MACHINE[1:]
    return (*MACHINE, "sigma0") if law in ("lugre", "dahl") else MACHINE


def make_runs(folder: Path) -> None:
    """Write the runs of each law, and the byte code of fricjax.

    The timed processes then have no byte code to compile.
    """
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    import rig

    import fricjax as fj

    # pip also compiles installed packages. Without byte code each process would need 0.2 s more.
    compileall.compile_dir(Path(fj.__file__).parent, quiet=1)
    t = np.arange(round(RATE * DURATION)) / RATE
    for law in (*LAWS, *OTHERS):
        random = np.random.default_rng(0)
        clean = [np.asarray(fj.simulate(machine(law), x0, t).x) for x0 in RELEASES]
        noisy = [x + rig.NOISE * random.standard_normal(t.size) for x in clean]
        np.savez(folder / f"{law}.npz", t=t, x=np.array(noisy))


def in_a_fresh_process(job: str, folder: Path) -> dict[str, Any]:
    """Measure a job in this process, which has computed nothing yet."""
    begin = time.perf_counter()
    import jax

    jax.config.update("jax_enable_x64", True)
    seen: dict[str, list[float]] = {"programs": [], "tracing": [], "compiling": []}
    watched = {
        "/jax/core/compile/jaxpr_trace_duration": "tracing",
        "/jax/core/compile/jaxpr_to_mlir_module_duration": "tracing",
        "/jax/core/compile/backend_compile_duration": "compiling",
    }

    def listen(event: str, seconds: float, **_: Any) -> None:
        if event in watched:
            seen[watched[event]].append(seconds)

    jax.monitoring.register_event_duration_secs_listener(listen)
    import numpy as np

    import fricjax as fj

    law = {"batch": "tanh", "compare": "coulomb"}.get(job, job)
    stored = np.load(folder / f"{law}.npz")
    runs = [fj.Trace(stored["t"], x) for x in stored["x"]]
    oscillator, names = machine(law), free(law)
    fits: list[Any]
    if job == "batch":
        fits = [lambda: fj.fit_batch(runs, oscillator, names)]
    elif job == "compare":
        rivals = [machine(name) for name in ("coulomb", "stribeck", "dahl", "lugre")]
        fits = [lambda: fj.compare(runs, rivals)] * 2
    else:
        fits = [lambda run=run: fj.fit(run, oscillator, names, throw=False) for run in runs]
    told: dict[str, Any] = {"import": time.perf_counter() - begin, "seconds": [], "programs": []}
    for fit in fits:
        begin, before = time.perf_counter(), len(seen["compiling"])
        fit()
        told["seconds"].append(time.perf_counter() - begin)
        told["programs"].append(len(seen["compiling"]) - before)
    return told | {"tracing": sum(seen["tracing"]), "compiling": sum(seen["compiling"])}


def timed(job: str, folder: Path, cache: Path) -> dict[str, Any]:
    """Run a job in a new process, with compiled programs in `cache`."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    environment = kept | {"FRICJAX_CACHE_DIR": str(cache)}
    if job == "pendulum":
        file = str(Path(os.environ["FRICJAX_DATA"]) / PENDULUM)
        command = [str(Path(sys.executable).parent / "fricjax"), "fit", file, *COMMAND.split()]
    else:
        command = [sys.executable, __file__, "--in-process", job, "--folder", str(folder)]
    begin = time.perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    whole = time.perf_counter() - begin
    if job == "pendulum":
        # Exit code 0: the fit describes the record; 3: it does not.
        if done.returncode not in (0, 3):
            raise RuntimeError(done.stderr)
        return {"whole": whole}
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout) | {"whole": whole}


def line(job: str, kind: str, found: dict[str, Any], asked: float | None) -> str:
    seconds = found.get("seconds", [found["whole"]])
    total = sum(seconds[:1]) if job in ("compare", *OTHERS) else sum(seconds)
    asked_for = "" if asked is None else f"{asked:6.0f}  {'' if total <= asked else 'slow'}"
    if job == "pendulum":
        return f"{job:15}{kind:8}{total:8.1f}{asked_for}"
    each, programs = (" + ".join(values) for values in ([f"{s:.2f}" for s in seconds], map(str, found["programs"])))
    spent = f"{found['import']:8.1f}{found['tracing']:9.1f}{found['compiling']:11.1f}"
    return f"{job:15}{kind:8}{total:8.1f}{asked_for or ' ' * 8:14}{spent}   {each} s, {programs} programs"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help=f"jobs of {', '.join(ASKED)}, separated by commas")
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--in-process", help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.in_process:
        print(json.dumps(in_a_fresh_process(options.in_process, options.folder)))
        return
    wanted = [name.strip() for name in options.only.split(",") if name.strip()] or list(ASKED)
    if not set(wanted) <= set(ASKED):
        parser.error(f"--only takes {', '.join(ASKED)}.")
    if "FRICJAX_DATA" not in os.environ:
        wanted = [job for job in wanted if job != "pendulum"]
    print(f"{'job':15}{'cache':8}{'seconds':>8}{'limit':>6}{'import':>16}{'tracing':>9}{'compiling':>11}   each")
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        make_runs(Path(scratch))
        for job in wanted:
            for kind, asked in zip(("empty", "filled"), ASKED[job], strict=True):
                found = timed(job, Path(scratch), Path(scratch) / f"programs-{job}")
                print(line(job, kind, found, asked), flush=True)
                rows.append({"job": job, "cache": kind, "asked": asked} | found)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
