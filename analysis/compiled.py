"""Loops as machine code (numba, extra `fast`): that of `closed_loop`, where the law is a function.

What is compiled of it is the very source that runs without numba, and only `+ - * /`, square roots
and comparisons are in it, so the bits are the same. The machine code is kept in numba's cache in a
file named after the code of every function in it: a changed law is compiled anew.
"""

import hashlib
from collections.abc import Callable, Iterable
from functools import cache
from importlib.util import find_spec
from math import floor
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Run = Callable[..., tuple[Floats, Floats]]
Function = Callable[..., Any]


@cache
def compiled_run(law: Function, step: Function) -> Run | None:
    """What `closed_loop.simulate` may call for `law` and `step`; None without numba."""
    if find_spec("numba") is None:
        return None
    functions = _reached(law, _reached(step, {}))
    for function in functions:
        _make_callable(function)
    loop = _compiled(_make_loop(law, step), "loop", functions)

    def run(
        controller: Any,
        plant: Any,
        inputs: Floats,
        start: tuple[float, float],
        waiting: list[float],
        limit: float,
        encoder_step_m: float,
    ) -> tuple[Floats, Floats]:
        rows = np.empty((len(inputs), 3))
        states = np.empty((len(inputs), len(controller.memory)))
        controller.memory = loop(
            controller.gains,
            controller.memory,
            plant.constants,
            inputs,
            start,
            np.array(waiting, dtype=np.float64),
            limit,
            encoder_step_m,
            rows,
            states,
        )
        return rows, states

    return run


@cache
def machine_code(function: FunctionType) -> Function | None:
    """A function of arrays and numbers that calls no other as machine code; None without numba.

    What is divided by zero is as in NumPy: without a question, which would take most of the time.
    """
    if find_spec("numba") is None:
        return None
    copy = FunctionType(function.__code__, function.__globals__, function.__name__)
    copy.__module__ = function.__module__
    return _compiled(copy, function.__name__, [function], error_model="numpy")


def _compiled(
    plain: Function, name: str, functions: Iterable[FunctionType], **options: Any
) -> Function:
    import numba

    plain.__qualname__ = f"{name}_{_digest(functions)}"  # names the file that numba keeps
    try:
        compiled: Function = numba.njit(cache=True, **options)(plain)
    except RuntimeError:  # no folder to keep it in
        compiled = numba.njit(**options)(plain)
    return compiled


@cache
def _make_callable(function: FunctionType) -> None:
    """Let compiled code call `function`, which stays what it is."""
    from numba.extending import register_jitable

    register_jitable(function)


def _reached(function: Any, found: dict[FunctionType, None]) -> dict[FunctionType, None]:
    """`found` with `function` and the plain functions that it calls, and those that they call."""
    if function not in found:
        found[function] = None
        for name in function.__code__.co_names:
            called = function.__globals__.get(name)
            if isinstance(called, FunctionType):
                _reached(called, found)
    return found


def _digest(functions: Iterable[FunctionType]) -> str:
    """Of all that decides what machine code does, and of the types that numba names in its file."""
    written = [_written(function) for function in functions]
    return hashlib.sha256(repr(written).encode()).hexdigest()[:16]


def _written(function: FunctionType) -> tuple[Any, ...]:
    """Where `function` is, its types, its code and the numbers that it takes from its module."""
    code = function.__code__
    taken = [function.__globals__.get(name) for name in code.co_names]
    numbers = [value for value in taken if isinstance(value, float | tuple)]
    where = (function.__module__, function.__qualname__, function.__annotations__)
    return *where, code.co_code, code.co_consts, code.co_names, numbers


def _make_loop(law: Function, step: Function) -> Function:
    """As `closed_loop._run`, row by row of arrays."""

    def loop(  # type: ignore[no-untyped-def]  # noqa: ANN202
        gains,  # noqa: ANN001
        memory,  # noqa: ANN001
        plant,  # noqa: ANN001
        inputs,  # noqa: ANN001
        start,  # noqa: ANN001
        waiting,  # noqa: ANN001
        limit,  # noqa: ANN001
        encoder_step_m,  # noqa: ANN001
        rows,  # noqa: ANN001
        states,  # noqa: ANN001
    ):
        position, velocity = start
        delay = len(waiting)
        for k in range(len(inputs)):
            asked_m, asked_m_s, asked_m_s2 = inputs[k, 0], inputs[k, 1], inputs[k, 2]
            off_m, off_m_s, push = inputs[k, 3], inputs[k, 4], inputs[k, 5]
            seen_m = position
            if encoder_step_m != 0.0:
                seen_m = floor(position / encoder_step_m + 0.5) * encoder_step_m
            seen = (off_m + seen_m, velocity + off_m_s)
            wanted, memory = law(gains, memory, asked_m, asked_m_s, asked_m_s2, *seen)
            rows[k, 0], rows[k, 1], rows[k, 2] = position, velocity, wanted
            for place in range(len(memory)):
                states[k, place] = memory[place]
            acting = limit if wanted > limit else -limit if wanted < -limit else wanted
            if delay > 0:
                acting, waiting[k % delay] = waiting[k % delay], acting
            position, velocity = step(plant, position, velocity, acting, push)
        return memory

    return loop
