"""Programs of few kernels, for which the compiler takes two thirds of the time.

XLA for the CPU makes of every fused operation of a program a function with a module and passes of its own, at ten to
twenty milliseconds each, and a fit has 300 to 600 of them. Of a call that is marked as small it makes one function,
whatever is in it. So operations that follow one another are gathered into such calls, once all derivatives are taken
and all batches are laid out.

What a call may hold is not promised anywhere. It was tried for the versions named here; with others, programs are
compiled as they are. Three things end the process where another compiler would complain, and are kept away from it:

- a call with an argument that nothing in it uses, or of which simplification leaves no use. So arguments pass a
  barrier, which keeps what is known of them outside, and one number made of all of them is returned.
- a call of whose results none is wanted. So all of them pass a barrier with that number.
- an array without elements that is returned.
"""

import functools
import math
import platform
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.experimental.xla_metadata import xla_metadata_call
from jax.extend import core

# Whether these are a version of JAX and a processor for which the marks are known to do what is said above.
_TRIED = jax.__version_info__[:2] == (0, 12) and platform.machine() in ("x86_64", "AMD64")
_MARKS = {"inlineable": "false", "xla_cpu_small_call": "true"}
# Most operations of a kernel: LLVM's time grows faster than what it is given, and two cores want two kernels.
_MOST, _LEAST = 500, 4
# Longest arrays of a kernel: XLA shares what is longer among threads, and a kernel has one. With 2048 and more the warm
# solves of Tanh and Stribeck take a third longer; from 128 to 1024 they are as fast as without kernels.
_LONGEST = 1024
# Longest array that is copied for a change of a part of it. Outside of kernels it is changed where it is.
_COPIED = 64

# Sums of long arrays would be handed to a library, which a call cannot hold. Of what LLVM does by default the last
# level takes it a quarter of its time, and no fit is faster for it.
OPTIONS = {"xla_cpu_experimental_ynn_fusion_type": "", "xla_backend_optimization_level": 2} if _TRIED else {}

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


def in_few_kernels(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, to be compiled with `OPTIONS`; it cannot be differentiated or batched any more.

    Args:
        function: of pytrees of arrays; returns one.

    Examples:
        >>> import jax.numpy as jnp
        >>> def wave(t):
        ...     return jnp.exp(-t) * jnp.cos(t), jnp.max(t)
        >>> few = jax.jit(in_few_kernels(wave))
        >>> bool(jnp.allclose(few(np.arange(3.0))[0], wave(np.arange(3.0))[0]))
        True
    """
    if not _TRIED:
        return function

    @functools.wraps(function)
    def few(*args: Any) -> Any:
        traced = jax.jit(function).trace(*args)
        gathered = core.jaxpr_as_fun(_Pass().gathered(traced.lojax.jaxpr))
        return jax.tree.unflatten(jax.tree.structure(traced.out_info), gathered(*jax.tree.leaves(args)))

    return few


class _Contents(NamedTuple):
    """What is in a program, with all that it calls.

    Attributes:
        size: how many operations.
        known: whether a kernel can hold them.
        short: whether none of them is one that a kernel does slower.
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
        """A program, or a body, whose operations are gathered into kernels."""
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
            # What needs nothing of the run goes before it.
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
        """Whether an operation is gathered with others."""
        size, known, short = self._of(eqn)
        return known and short and size <= _MOST

    def _of(self, eqn: Any) -> _Contents:
        """The contents of an operation."""
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
        """An operation; of a loop or a choice with its bodies gathered, but not with what is asked before each turn."""
        if eqn.primitive.name not in _CONTROL:
            return eqn
        params = {
            name: jax.tree.map(self.gathered, value, is_leaf=_is_body)
            for name, value in eqn.params.items()
            if name != "cond_jaxpr" and _holds_bodies(value)
        }
        return eqn.replace(params=eqn.params | params)


class _Inlined:
    """Operations with those of the functions that they call in place of some of the calls.

    Args:
        whether: which calls are replaced.

    Attributes:
        eqns: the operations.
        constants: that these functions bring along, with their values.
    """

    def __init__(self, whether: Callable[[Any], bool]) -> None:
        self.eqns: list[Any] = []
        self.constants: dict[Any, Any] = {}
        self._whether = whether
        self._now: dict[Any, Any] = {}

    def add(self, jaxpr: core.Jaxpr) -> list[Any]:
        """Append those of a function whose arguments are known; what it returns."""
        for eqn in jaxpr.eqns:
            invars = [self._atom(each) for each in eqn.invars]
            inner = _CALLS.get(eqn.primitive.name)
            if inner is None or not self._whether(eqn):
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


def _is_plain(aval: Any) -> bool:
    """Whether something is an array of some real numbers or truth values."""
    return isinstance(aval.dtype, np.dtype) and aval.dtype.kind in "biuf" and 0 not in aval.shape


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
    sealed, raw = ([core.Var(each.aval) for each in atoms] for atoms in (needed, [*results, number]))
    call, barrier = _patterns()
    before = barrier.replace(invars=needed, outvars=sealed, **place)
    params = call.params | {"jaxpr": body}
    kernel = call.replace(invars=sealed, outvars=raw, params=params, **place)
    # The number is wanted by nobody, and JAX takes away what is not: so it passes a barrier with all results, of which
    # any may turn out to be wanted by nobody either.
    behind = barrier.replace(invars=raw, outvars=[*results, core.Var(number.aval)], **place)
    return [before, kernel, behind]


@functools.cache
def _patterns() -> tuple[Any, Any]:
    """A marked call, and a barrier, to be copied."""
    call = jax.make_jaxpr(xla_metadata_call(lambda x: x, **_MARKS))(0.0)
    barrier = jax.make_jaxpr(lambda *x: jax.lax.optimization_barrier(x))(0.0, 0.0)
    return call.eqns[0], barrier.eqns[0]


def _touch(variables: Sequence[Any]) -> tuple[list[Any], Any]:
    """Operations that make one number of arrays, of long ones of their first elements, and the number."""
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

    # Like ones are added whole where they are short, for each operation costs the compiler as much as another.
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
    """To be copied, by their names: what takes one element of an array, makes it a number, and joins two."""

    def each(x: Any) -> Any:
        number = jax.lax.reshape(jax.lax.slice(x, (0,), (1,)), ())
        return jax.lax.add(jax.lax.convert_element_type(number, float), 1.0), jax.lax.bitwise_or(number, number)

    return {eqn.primitive.name: eqn for eqn in jax.make_jaxpr(each)(np.arange(2)).eqns}
