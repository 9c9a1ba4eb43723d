"""Compile marks: programs of few kernels, for shorter compile times.

XLA for the CPU compiles each fused operation of a program as a separate function, in ten to twenty milliseconds, and a
fit has 300 to 600 of them. XLA compiles a call that is marked as small into one function. This module collects
consecutive operations into such calls, after differentiation and batching. Compiling then takes two thirds of the
time.

XLA documents no rules for the content of a marked call. `enabled` is True only for the versions that were tried;
otherwise programs are compiled unchanged. Three cases abort the process instead of raising an error, so this module
avoids them:

- a call with an unused argument, also one that simplification makes unused. Arguments therefore pass an optimisation
  barrier, and the call returns one number that depends on all of them.
- a call with unused results only. All results therefore pass a barrier together with that number.
- a result array without elements.
"""

import functools
import math
import os
import platform
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jaxlib.version
import numpy as np
from jax.experimental.xla_metadata import xla_metadata_call
from jax.extend import core

KERNELS_VARIABLE = "FRICJAX_KERNELS"
# XLA is part of jaxlib. See "Constraints" in CONTRIBUTING.md before adding a version.
_TRIED_JAXLIB, _TRIED_MACHINES = ("0.12.0.1",), ("x86_64", "AMD64")
_MARKS = {"inlineable": "false", "xla_cpu_small_call": "true"}
# Largest and smallest number of operations in a kernel: the time of LLVM grows faster than linearly, and two cores can
# compile two kernels at once.
_MOST, _LEAST = 500, 4
# Longest array in a kernel: XLA computes longer ones with several threads, a kernel with one. From 2048 the warm solves
# of Tanh and Stribeck take a third longer; from 128 to 1024 they take the same time as without kernels.
_LONGEST = 1024
# Longest array that may be updated in a kernel, which copies it. Outside of kernels XLA updates arrays in place.
_COPIED = 64

# The first option keeps long sums out of a library, because a marked call cannot contain a library call. The second one
# saves a quarter of LLVM's time and makes no fit slower.
OPTIONS = {"xla_cpu_experimental_ynn_fusion_type": "", "xla_backend_optimization_level": 2}

_CONTROL = ("while", "scan", "cond")
# Calls that can be inlined, with the name of the parameter that holds the called program.
_CALLS = {
    "jit": "jaxpr",
    "closed_call": "call_jaxpr",
    "eval_jaxpr": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
}
_PARTIAL = ("dynamic_update_slice", "maybe_set", "copy", "select_if_vmap", "optimization_barrier", "scatter")
# Operations that were tried in kernels. Sorting, LAPACK, scattering of many rows and host callbacks are excluded.
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


def enabled() -> bool:
    """Return True if programs are to be marked.

    FRICJAX_KERNELS decides if it is set: "on" marks programs also with an untried jaxlib, in order to try it.
    """
    tried = jaxlib.version.__version__ in _TRIED_JAXLIB and platform.machine() in _TRIED_MACHINES
    asked = os.environ.get(KERNELS_VARIABLE, "").strip().lower()
    return asked not in ("off", "0", "no", "false") if asked else tried


def in_few_kernels(function: Callable[..., Any]) -> Callable[..., Any]:
    """Collect the operations of a function into marked calls.

    Compile the result with `OPTIONS`. It cannot be differentiated or batched.

    Args:
        function: maps pytrees of arrays to a pytree of arrays.

    Examples:
        >>> import jax.numpy as jnp
        >>> def wave(t):
        ...     return jnp.exp(-t) * jnp.cos(t), jnp.max(t)
        >>> few = jax.jit(in_few_kernels(wave))
        >>> bool(jnp.allclose(few(np.arange(3.0))[0], wave(np.arange(3.0))[0]))
        True
    """

    @functools.wraps(function)
    def few(*args: Any) -> Any:
        traced = jax.jit(function).trace(*args)
        gathered = core.jaxpr_as_fun(_Pass().gathered(traced.lojax.jaxpr))
        return jax.tree.unflatten(jax.tree.structure(traced.out_info), gathered(*jax.tree.leaves(args)))

    return few


class _Contents(NamedTuple):
    """Summary of a program and the programs that it calls.

    Attributes:
        size: number of operations.
        known: True if a kernel can contain all of them.
        short: True if a kernel computes them as fast as XLA does otherwise.
    """

    size: int
    known: bool
    short: bool


def _together(parts: Sequence[_Contents]) -> _Contents:
    return _Contents(
        sum(each.size for each in parts), all(each.known for each in parts), all(each.short for each in parts)
    )


class _Pass:
    """One pass over a program and the bodies of its loops."""

    def __init__(self) -> None:
        self._contents: dict[core.Jaxpr, _Contents] = {}

    def gathered(self, jaxpr: core.Jaxpr) -> core.Jaxpr:
        """Return a program with its operations collected into kernels."""
        inlined = _Inlined(lambda eqn: not self._joins(eqn))
        outvars = inlined.add(jaxpr)
        last = {each: k for k, eqn in enumerate(inlined.eqns) for each in _variables(eqn.invars)}
        last |= dict.fromkeys(_variables(outvars), len(inlined.eqns))
        names = jaxpr.debug_info.with_unknown_names()
        done: list[Any] = []
        run: list[Any] = []
        size, made = 0, set()

        def close(until: int) -> None:
            results = [each for eqn in run for each in eqn.outvars if last.get(each, -1) >= until]
            done.extend(_kernel(run, results, names) if size >= _LEAST else run)
            run.clear()
            made.clear()

        for k, eqn in enumerate(inlined.eqns):
            joins, more = self._joins(eqn), self._of(eqn).size
            # An operation that does not depend on the open kernel goes before it.
            if (joins and size + more > _MOST) or (not joins and not made.isdisjoint(_variables(eqn.invars))):
                close(k)
                size = 0
            if joins:
                run.append(eqn)
                made.update(eqn.outvars)
                size += more
            else:
                done.append(self._with_bodies(eqn))
        close(len(inlined.eqns))
        constants = [*jaxpr.constvars, *inlined.constants]
        values = [*jaxpr.consts, *inlined.constants.values()]
        return core.Jaxpr(
            constants, jaxpr.invars, outvars, done, jaxpr.effects, jaxpr.debug_info, consts=values or None
        )

    def _joins(self, eqn: Any) -> bool:
        """Return True if a kernel may contain an operation."""
        size, known, short = self._of(eqn)
        return known and short and size <= _MOST

    def _of(self, eqn: Any) -> _Contents:
        """Summarise an operation."""
        bodies = list(core.jaxprs_in_params(eqn.params))
        name, plain = eqn.primitive.name, all(_is_plain(atom.aval) for atom in [*eqn.invars, *eqn.outvars])
        if bodies:
            inner = _together([self._of_body(body) for body in bodies])
            return inner._replace(known=inner.known and plain and (name in _CONTROL or name in _CALLS))
        known = plain and name in _KNOWN and not eqn.effects
        if name == "scatter":
            known = known and math.prod(eqn.invars[1].aval.shape[:-1]) == 1
        longest = _COPIED if name in _PARTIAL else _LONGEST
        return _Contents(1, known, all(math.prod(atom.aval.shape) <= longest for atom in eqn.outvars))

    def _of_body(self, jaxpr: core.Jaxpr) -> _Contents:
        if jaxpr not in self._contents:
            self._contents[jaxpr] = _together([self._of(eqn) for eqn in jaxpr.eqns])
        return self._contents[jaxpr]

    def _with_bodies(self, eqn: Any) -> Any:
        """Collect the bodies of a loop or a branch into kernels.

        The condition of a loop stays as it is.
        """
        if eqn.primitive.name not in _CONTROL:
            return eqn
        params = {
            name: jax.tree.map(self.gathered, value, is_leaf=_is_body)
            for name, value in eqn.params.items()
            if name != "cond_jaxpr" and _holds_bodies(value)
        }
        return eqn.replace(params=eqn.params | params)


class _Inlined:
    """List of operations with some of the calls inlined.

    Args:
        whether: predicate for the calls to inline.

    Attributes:
        eqns: the operations.
        constants: constants of the inlined functions, with their values.
    """

    def __init__(self, whether: Callable[[Any], bool]) -> None:
        self.eqns: list[Any] = []
        self.constants: dict[Any, Any] = {}
        self._whether = whether
        self._now: dict[Any, Any] = {}

    def add(self, jaxpr: core.Jaxpr) -> list[Any]:
        """Append the operations of a function and return its results."""
        for eqn in jaxpr.eqns:
            invars = [self._atom(each) for each in eqn.invars]
            inner = _CALLS.get(eqn.primitive.name)
            if inner is None or not self._whether(eqn):
                # A function that is called twice needs new variables for each call.
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


def _is_plain(aval: Any) -> bool:
    """Return True for a nonempty array of numbers or booleans."""
    return isinstance(aval.dtype, np.dtype) and aval.dtype.kind in "biuf" and 0 not in aval.shape


def _is_body(value: Any) -> bool:
    return isinstance(value, core.Jaxpr)


def _holds_bodies(value: Any) -> bool:
    return _is_body(value) or (isinstance(value, tuple) and len(value) > 0 and all(map(_is_body, value)))


def _kernel(run: Sequence[Any], results: list[Any], names: Any) -> list[Any]:
    """Return operations as one marked call between two barriers."""
    inside = {each for eqn in run for each in eqn.outvars}
    needed = list(dict.fromkeys(each for eqn in run for each in _variables(eqn.invars) if each not in inside))
    if not needed or not results:
        return list(run)
    place = {"source_info": run[0].source_info, "ctx": run[0].ctx}
    touch, number = _touch(needed)
    body = core.Jaxpr([], needed, [*results, number], [*run, *touch], frozenset(), names)
    sealed, raw = ([core.Var(each.aval) for each in atoms] for atoms in (needed, [*results, number]))
    call, barrier = _patterns()
    before = barrier.replace(invars=needed, outvars=sealed, **place)
    params = call.params | {"jaxpr": body}
    kernel = call.replace(invars=sealed, outvars=raw, params=params, **place)
    # JAX removes unused results. The number is unused, and each result may be, so all pass one barrier.
    behind = barrier.replace(invars=raw, outvars=[*results, core.Var(number.aval)], **place)
    return [before, kernel, behind]


@functools.cache
def _patterns() -> tuple[Any, Any]:
    """Return a marked call and a barrier as templates."""
    call = jax.make_jaxpr(xla_metadata_call(lambda x: x, **_MARKS))(0.0)
    barrier = jax.make_jaxpr(lambda *x: jax.lax.optimization_barrier(x))(0.0, 0.0)
    return call.eqns[0], barrier.eqns[0]


def _touch(variables: Sequence[Any]) -> tuple[list[Any], Any]:
    """Return operations that reduce arrays to one number, and that number.

    Long arrays contribute their first element.
    """
    operations, eqns = _operations(), []

    def then(name: str, atoms: list[Any], like: Any, **params: Any) -> Any:
        pattern, result = operations[name], core.Var(like)
        eqns.append(pattern.replace(invars=atoms, outvars=[result], params=pattern.params | params))
        return result

    def scalar(array: Any) -> Any:
        ones = (1,) * array.aval.ndim
        if not ones:
            return array
        zeros = tuple([0 for _ in ones])
        first = then("slice", [array], array.aval.update(shape=ones), start_indices=zeros, limit_indices=ones)
        return then("reshape", [first], first.aval.update(shape=()))

    # Short arrays of the same shape are added as a whole: compile time depends on the number of operations.
    alike: dict[Any, Any] = {}
    for variable in variables:
        each = variable if math.prod(variable.aval.shape) <= _COPIED else scalar(variable)
        kind = (each.aval.shape, each.aval.dtype)
        name = "or" if each.aval.dtype == bool else "add"
        alike[kind] = then(name, [alike[kind], each], each.aval) if kind in alike else each
    total = None
    for each in alike.values():
        number = scalar(each)
        if number.aval.dtype != float:
            number = then("convert_element_type", [number], operations["add"].outvars[0].aval)
        total = number if total is None else then("add", [total, number], number.aval)
    return eqns, total


@functools.cache
def _operations() -> dict[str, Any]:
    """Return template operations by name: slice, reshape, convert, add, or."""

    def each(x: Any) -> Any:
        number = jax.lax.reshape(jax.lax.slice(x, (0,), (1,)), ())
        return jax.lax.add(jax.lax.convert_element_type(number, float), 1.0), jax.lax.bitwise_or(number, number)

    return {eqn.primitive.name: eqn for eqn in jax.make_jaxpr(each)(np.arange(2)).eqns}
