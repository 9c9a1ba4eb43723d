"""Evaluate a traced function by NumPy, without compilation.

A jaxpr is the list of the elementary operations of a traced function. The interpreter applies the NumPy function of the
same name to each of them. An operation without such a function is left to JAX, which compiles it once.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, Var  # pyright: ignore[reportPrivateImportUsage]


def _select(which: Any, *cases: Any) -> Any:
    return np.where(which, cases[1], cases[0]) if len(cases) == 2 else np.choose(which, cases)


def _dot(a: Any, b: Any, *, dimension_numbers: Any) -> Any:
    return np.tensordot(a, b, dimension_numbers[0])


def _broadcast(a: Any, *, shape: Sequence[int], broadcast_dimensions: Sequence[int]) -> Any:
    sizes = [1] * len(shape)
    for dimension, size in zip(broadcast_dimensions, np.shape(a), strict=True):
        sizes[dimension] = size
    return np.broadcast_to(np.reshape(a, sizes), shape)


def _slice(a: Any, *, start_indices: Sequence[int], limit_indices: Sequence[int], strides: Any) -> Any:
    steps = strides or (1,) * np.ndim(a)
    return a[tuple(slice(*each) for each in zip(start_indices, limit_indices, steps, strict=True))]


def _pad(a: Any, value: Any, *, padding_config: Any) -> Any:
    return np.pad(a, [(low, high) for low, high, _ in padding_config], constant_values=value)


def _cumsum(a: Any, *, axis: int, reverse: bool) -> Any:
    return np.flip(np.cumsum(np.flip(a, axis), axis), axis) if reverse else np.cumsum(a, axis)


# Functions without parameters, by the name of the operation in JAX.
_PLAIN: Mapping[str, Callable[..., Any]] = {
    "abs": np.abs,
    "acos": np.arccos,
    "acosh": np.arccosh,
    "add": np.add,
    "add_any": np.add,
    "and": np.logical_and,
    "asin": np.arcsin,
    "asinh": np.arcsinh,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "atanh": np.arctanh,
    "cbrt": np.cbrt,
    "ceil": np.ceil,
    "clamp": lambda low, a, high: np.clip(a, low, high),
    "copy": lambda a: a,
    "copy_p": lambda a: a,
    "cos": np.cos,
    "cosh": np.cosh,
    "div": np.divide,
    "eq": np.equal,
    "exp": np.exp,
    "exp2": np.exp2,
    "expm1": np.expm1,
    "floor": np.floor,
    "ge": np.greater_equal,
    "gt": np.greater,
    "is_finite": np.isfinite,
    "le": np.less_equal,
    "log": np.log,
    "log1p": np.log1p,
    "logistic": lambda a: 1 / (1 + np.exp(-a)),
    "lt": np.less,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "ne": np.not_equal,
    "neg": np.negative,
    "not": np.logical_not,
    "one_minus_square": lambda a: 1 - a * a,
    "optimization_barrier": lambda *a: list(a),
    "or": np.logical_or,
    "pow": np.power,
    "rem": np.fmod,
    "rsqrt": lambda a: 1 / np.sqrt(a),
    "select_n": _select,
    "sign": np.sign,
    "sin": np.sin,
    "sinh": np.sinh,
    "sqrt": np.sqrt,
    "square": np.square,
    "stop_gradient": lambda a: a,
    "sub": np.subtract,
    "tan": np.tan,
    "tanh": np.tanh,
    "zeros_like": np.zeros_like,
}
# Functions with parameters, which the second entry lists.
_WITH: Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
    "broadcast_in_dim": (_broadcast, ("shape", "broadcast_dimensions")),
    "concatenate": (lambda *a, dimension: np.concatenate(a, dimension), ("dimension",)),
    "convert_element_type": (lambda a, new_dtype: np.asarray(a).astype(new_dtype, copy=False), ("new_dtype",)),
    "cumsum": (_cumsum, ("axis", "reverse")),
    "dot_general": (_dot, ("dimension_numbers",)),
    "expand_dims": (lambda a, dimensions: np.expand_dims(a, dimensions), ("dimensions",)),
    "integer_pow": (lambda a, y: a**y if y >= 0 else 1 / a**-y, ("y",)),
    "iota": (
        lambda *, dtype, shape, dimension: _broadcast(
            np.arange(shape[dimension], dtype=dtype), shape=shape, broadcast_dimensions=(dimension,)
        ),
        ("dtype", "shape", "dimension"),
    ),
    "split": (lambda a, sizes, axis: np.split(a, np.cumsum(sizes)[:-1], axis), ("sizes", "axis")),
    "reduce_max": (lambda a, axes: np.max(a, axes), ("axes",)),
    "reduce_min": (lambda a, axes: np.min(a, axes), ("axes",)),
    "reduce_sum": (lambda a, axes: np.sum(a, axes), ("axes",)),
    "reshape": (lambda a, new_sizes: np.reshape(a, new_sizes), ("new_sizes",)),
    "slice": (_slice, ("start_indices", "limit_indices", "strides")),
    "squeeze": (lambda a, dimensions: np.squeeze(a, tuple(dimensions)), ("dimensions",)),
    "stack": (lambda *a, axis: np.stack(a, axis), ("axis",)),
    "unstack": (lambda a, axis: list(np.moveaxis(a, axis, 0)), ("axis",)),
    "transpose": (lambda a, permutation: np.transpose(a, permutation), ("permutation",)),
}
# Operations that call another jaxpr, and the parameter that holds it.
_CALLS: Mapping[str, str] = {
    "closed_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "jit": "jaxpr",
    "pjit": "jaxpr",
}


def evaluate(program: ClosedJaxpr, *arguments: Any) -> list[Any]:
    """Evaluate a jaxpr by NumPy.

    Equal operations on equal arguments are evaluated once. The derivative by each coefficient repeats the forces, so
    this saves about half of the operations.

    Args:
        program: jaxpr of a function, as `jax.make_jaxpr` returns it.
        arguments: one array or number for each input of the jaxpr.

    Returns:
        One NumPy array or number for each output of the jaxpr.

    Examples:
        >>> import jax
        >>> program = jax.make_jaxpr(lambda speed: jax.numpy.tanh(speed / 2.0))(1.0)
        >>> [f"{values[1]:.4f}" for values in evaluate(program, np.array([0.0, 2.0]))]
        ['0.7616']
    """
    return _run(program.jaxpr, program.consts, arguments, {})


def _run(jaxpr: Jaxpr, constants: Sequence[Any], arguments: Sequence[Any], earlier: dict[Any, Any]) -> list[Any]:
    """Evaluate the operations in order.

    `earlier` holds results by operation and identity of the arguments. It also holds the arguments, so that their
    identities stay unique.
    """
    values: dict[Var, Any] = dict(zip([*jaxpr.constvars, *jaxpr.invars], [*constants, *arguments], strict=True))
    for equation in jaxpr.eqns:
        inputs = [atom.val if isinstance(atom, Literal) else values[atom] for atom in equation.invars]
        name, settings = equation.primitive.name, equation.params
        if name in _CALLS:
            inner = settings[_CALLS[name]]
            outputs = _run(inner.jaxpr, inner.consts, inputs, earlier)
        else:
            outputs = _apply(equation, name, settings, inputs, earlier)
        values.update(zip(equation.outvars, outputs, strict=True))
    return [atom.val if isinstance(atom, Literal) else values[atom] for atom in jaxpr.outvars]


def _apply(equation: Any, name: str, settings: Mapping[str, Any], inputs: list[Any], earlier: dict[Any, Any]) -> Any:
    """Return the outputs of one operation, or of an equal earlier one."""
    function, wanted = (_PLAIN[name], ()) if name in _PLAIN else _WITH.get(name, (None, ()))
    if function is None or any(settings.get("dimension_numbers", ((), ()))[1]):
        outputs = equation.primitive.bind(*inputs, **settings)
        return [np.asarray(each) for each in (outputs if equation.primitive.multiple_results else [outputs])]
    chosen = {each: settings[each] for each in wanted}
    # Numbers are compared by value, because equal literals are different objects.
    alike = ((type(a), float(a)) if np.ndim(a) == 0 else id(a) for a in inputs)
    key = (name, *alike, *map(str, chosen.values()))
    if key not in earlier:
        output = function(*inputs, **chosen)
        earlier[key] = (output if equation.primitive.multiple_results else [output], inputs)
    return earlier[key][0]
