"""Programs of few kernels, for which the compiler takes half the time.

XLA for the CPU makes of every fused operation of a program a function with a module and passes of its own, at ten to
twenty milliseconds each, and a fit has 300 to 600 of them. Of a call that is marked as small it makes one function,
whatever is in it. So operations that follow one another are gathered into such calls, once all derivatives are taken
and all batches are laid out.

What a call may hold is not promised anywhere. It was tried for the versions named here; with others, programs are
compiled as they are. Two things end the process where another compiler would complain, and are kept away from it:

- a call with an argument that nothing in it uses, or of which simplification leaves no use. So arguments pass a
  barrier, which keeps what is known of them outside, and one number made of all of them is returned.
- an array without elements that is returned.
"""

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.xla_metadata import xla_metadata_call
from jax.extend import core

# Whether this is a version of JAX for which the marks are known to do what is said above.
_TRIED = jax.version.__version_info__[:2] == (0, 12)
_MARKS = {"inlineable": "false", "xla_cpu_small_call": "true"}
# Most operations of a kernel: LLVM's time grows faster than what it is given, and two cores want two kernels.
_MOST, _LEAST = 500, 4
# Longest arrays of a kernel: XLA shares what is longer among threads, and a kernel has one.
_LONGEST = 4096
# Longest array that is copied for a change of a part of it. Outside of kernels it is changed where it is.
_COPIED = 64

# Sums of long arrays would be handed to a library, which a call cannot hold.
OPTIONS = {"xla_cpu_experimental_ynn_fusion_type": ""} if _TRIED else {}

_CONTROL = ("while", "scan", "cond")
# Calls that mean nothing but what they call, and the name of that.
_CALLS = {
    "jit": "jaxpr",
    "closed_call": "call_jaxpr",
    "eval_jaxpr": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
}
_PARTIAL = ("dynamic_update_slice", "maybe_set", "copy", "select_if_vmap", "optimization_barrier", "scatter")
# Sorting, linear algebra of LAPACK, scattering of many rows and calls of the host are not among them.
_NAMES = """
abs add add_any and argmax argmin asinh atan atan2 atanh broadcast_in_dim cbrt ceil clamp concatenate
convert_element_type copy cos cosh cumlogsumexp cummax cummin cumprod cumsum div dot_general dynamic_slice
dynamic_update_slice eq erf erf_inv erfc exp exp2 expm1 floor gather ge gt integer_pow iota is_finite le
lgamma log log1p logistic lt lt_to max maybe_set min mul ne neg nextafter nonbatchable
nondifferentiable_backward not one_minus_square optimization_barrier or pad platform_index pow reduce_and
reduce_max reduce_min reduce_or reduce_prod reduce_sum rem reshape rev round rsqrt scatter select_if_vmap
select_n sign sin sinh slice split sqrt square squeeze stack stop_gradient sub tan tanh transpose unstack
unvmap_any xor
"""
_KNOWN = frozenset(_NAMES.split())


def in_few_kernels(function: Callable[..., Any], *args: Any) -> Callable[..., Any]:
    """The function for arguments of the same shapes, to be compiled with `OPTIONS`.

    Args:
        function: of pytrees of arrays; returns one.
        args: arguments of the shapes that it will be compiled for.

    Examples:
        >>> def wave(t):
        ...     return jnp.exp(-t) * jnp.cos(t), jnp.max(t)
        >>> few = jax.jit(in_few_kernels(wave, np.arange(3.0)))
        >>> bool(jnp.allclose(few(np.arange(3.0))[0], wave(np.arange(3.0))[0]))
        True
    """
    if not _TRIED:
        return function
    traced = jax.jit(function).trace(*args)
    gathered = core.jaxpr_as_fun(_gathered(traced.lojax.jaxpr))
    structure = jax.tree.structure(traced.out_info)

    @functools.wraps(function)
    def few(*args: Any) -> Any:
        return jax.tree.unflatten(structure, gathered(*jax.tree.leaves(args)))

    return few


def _gathered(jaxpr: core.Jaxpr) -> core.Jaxpr:
    """A program, or the body of a loop, whose operations are gathered into kernels."""
    inlined = _Inlined()
    outvars = inlined.add(jaxpr)
    last = {}
    for k, eqn in enumerate(inlined.eqns):
        last |= dict.fromkeys(_variables(eqn.invars), k)
    last |= dict.fromkeys(_variables(outvars), len(inlined.eqns))
    done: list[Any] = []
    names = jaxpr.debug_info.with_unknown_names()
    run: list[Any] = []

    def close(until: int) -> None:
        results = [each for eqn in run for each in eqn.outvars if last.get(each, -1) >= until]
        done.extend(_kernel(run, results, names) if sum(map(_size, run)) >= _LEAST else run)
        run.clear()

    for k, eqn in enumerate(inlined.eqns):
        if _may_join(eqn):
            if sum(map(_size, [*run, eqn])) > _MOST:
                close(k)
            run.append(eqn)
            continue
        # What needs nothing of the run goes before it.
        if set(_variables(eqn.invars)) & {each for other in run for each in other.outvars}:
            close(k)
        done.append(_with_bodies(eqn) if eqn.primitive.name in _CONTROL else eqn)
    close(len(inlined.eqns))
    constants = [*jaxpr.constvars, *inlined.constants]
    values = [*jaxpr.consts, *inlined.constants.values()]
    return core.Jaxpr(constants, jaxpr.invars, outvars, done, jaxpr.effects, jaxpr.debug_info, consts=values or None)


class _Inlined:
    """Operations with those of the functions that they call in place of the calls.

    Attributes:
        eqns: the operations.
        constants: that these functions bring along, with their values.
    """

    def __init__(self) -> None:
        self.eqns: list[Any] = []
        self.constants: dict[Any, Any] = {}
        self._now: dict[Any, Any] = {}

    def add(self, jaxpr: core.Jaxpr) -> list[Any]:
        """Append those of a function whose arguments are known; what it returns."""
        for eqn in jaxpr.eqns:
            invars = [self._atom(each) for each in eqn.invars]
            inner = _CALLS.get(eqn.primitive.name)
            if inner is None:
                # The same function may be called twice, and each time gives other results.
                outvars = [self._new(each) for each in eqn.outvars]
                self.eqns.append(eqn.replace(invars=invars, outvars=outvars))
                continue
            called = eqn.params[inner]
            for constant, value in zip(called.constvars, called.consts, strict=True):
                self.constants[self._new(constant)] = value
            self._now |= dict(zip(called.invars, invars, strict=True))
            self._now |= dict(zip(eqn.outvars, self.add(called), strict=True))
        return [self._atom(each) for each in jaxpr.outvars]

    def _new(self, variable: Any) -> Any:
        self._now[variable] = variable if isinstance(variable, core.DropVar) else core.Var(variable.aval)
        return self._now[variable]

    def _atom(self, atom: Any) -> Any:
        return atom if isinstance(atom, core.Literal) else self._now.get(atom, atom)


def _variables(atoms: Iterable[Any]) -> list[Any]:
    return [atom for atom in atoms if not isinstance(atom, core.Literal)]


def _size(eqn: Any) -> int:
    """How many operations there are in one."""
    return sum(_size(inner) for body in core.jaxprs_in_params(eqn.params) for inner in body.eqns) or 1


def _known(eqn: Any) -> bool:
    """Whether a kernel can hold an operation, and all that it calls."""
    bodies = list(core.jaxprs_in_params(eqn.params))
    if bodies:
        named = eqn.primitive.name in _CONTROL or eqn.primitive.name in _CALLS
        return named and all(_known(inner) for body in bodies for inner in body.eqns)
    if eqn.primitive.name == "scatter" and math.prod(eqn.invars[1].aval.shape[:-1]) != 1:
        return False
    return eqn.primitive.name in _KNOWN and not eqn.effects


def _may_join(eqn: Any) -> bool:
    """Whether an operation may be gathered with others."""
    shapes = [atom.aval.shape for atom in eqn.outvars]
    longest = _COPIED if eqn.primitive.name in _PARTIAL else _LONGEST
    # A loop is taken with all that it carries: to leave it is to compile its body by itself.
    if eqn.primitive.name not in _CONTROL and any(math.prod(shape) > longest for shape in shapes):
        return False
    plain = all(_is_plain(atom.aval) for atom in [*eqn.invars, *eqn.outvars])
    return plain and _size(eqn) <= _MOST and _known(eqn)


def _is_plain(aval: Any) -> bool:
    """Whether something is an array of some real numbers or truth values."""
    return isinstance(aval.dtype, np.dtype) and aval.dtype.kind in "biuf" and 0 not in aval.shape


def _with_bodies(eqn: Any) -> Any:
    """A loop or a choice whose bodies are gathered; what decides whether a loop goes on is small anyway."""
    params = {
        name: value if name == "cond_jaxpr" else jax.tree.map(_gathered, value, is_leaf=_is_body)
        for name, value in eqn.params.items()
        if _holds_bodies(value)
    }
    return eqn.replace(params=eqn.params | params)


def _is_body(value: Any) -> bool:
    return isinstance(value, core.Jaxpr)


def _holds_bodies(value: Any) -> bool:
    return _is_body(value) or (isinstance(value, tuple) and len(value) > 0 and all(map(_is_body, value)))


def _kernel(run: Sequence[Any], results: list[Any], names: Any) -> list[Any]:
    """Operations as one call, with the barriers before and behind it."""
    inside = {each for eqn in run for each in eqn.outvars}
    needed = list(dict.fromkeys(each for eqn in run for each in _variables(eqn.invars) if each not in inside))
    if not needed or not results:
        return list(run)
    place = {"source_info": run[0].source_info, "ctx": run[0].ctx}
    touch, number = _touch(needed)
    body = core.Jaxpr([], needed, [*results, number], [*run, *touch], frozenset(), names)
    sealed, raw = [core.Var(each.aval) for each in needed], [core.Var(results[0].aval), core.Var(number.aval)]
    call, barrier = _patterns()
    before = barrier.replace(invars=needed, outvars=sealed, **place)
    params = call.params | {"jaxpr": body}
    kernel = call.replace(invars=sealed, outvars=[raw[0], *results[1:], raw[1]], params=params, **place)
    # The number is returned by the call and wanted by nobody: without a barrier JAX would take it away.
    behind = barrier.replace(invars=raw, outvars=[results[0], core.Var(number.aval)], **place)
    return [before, kernel, behind]


@functools.cache
def _patterns() -> tuple[Any, Any]:
    """A marked call, and a barrier, to be copied."""
    call = jax.make_jaxpr(xla_metadata_call(lambda x: x, **_MARKS))(0.0)
    barrier = jax.make_jaxpr(lambda *x: jax.lax.optimization_barrier(x))(0.0, 0.0)
    return call.eqns[0], barrier.eqns[0]


def _touch(variables: Sequence[Any]) -> tuple[list[Any], Any]:
    """Operations that make one number of the first elements of arrays, and the number."""
    eqns, numbers = [], []
    for variable in variables:
        first = _first(variable.aval.shape, variable.aval.dtype)
        numbers.append(core.Var(first.outvars[0].aval))
        eqns.append(first.replace(invars=[variable], outvars=[numbers[-1]]))
    while len(numbers) > 1:
        total = core.Var(numbers[0].aval)
        eqns.append(_plus().replace(invars=[numbers.pop(), numbers.pop()], outvars=[total]))
        numbers.append(total)
    return eqns, numbers[0]


@functools.cache
def _first(shape: tuple[int, ...], dtype: Any) -> Any:
    """The first element of an array as a floating-point number, as an operation to be copied."""
    first = jax.jit(lambda x: jnp.ravel(x)[0].astype(float) if shape else jnp.asarray(x, float))
    return jax.make_jaxpr(first)(jax.ShapeDtypeStruct(shape, dtype)).eqns[0]


@functools.cache
def _plus() -> Any:
    return jax.make_jaxpr(jnp.add)(np.zeros(()), np.zeros(())).eqns[0]
