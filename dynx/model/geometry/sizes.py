"""Checks of the sizes of shapes, with the name of the size in each error."""

from __future__ import annotations

from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.elements import Vector
from dynx.model.numbers import MAX_MAGNITUDE, checked_array, is_real


def positive_number(name: str, value: object) -> float:
    """Return a positive number below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    if is_real(value) and 0.0 < float(value) < MAX_MAGNITUDE:
        return float(value)
    raise ArgumentError(f"{name} is {shown(value)}; wanted a positive number below {MAX_MAGNITUDE:g}")


def finite_numbers(name: str, values: object, count: int) -> tuple[float, ...]:
    """Return `count` finite numbers below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    array = checked_array(name, values, count)  # type: ignore[arg-type]  # anything is checked
    if array.ndim != 1:
        raise ShapeError(f"{name} has shape {array.shape}; wanted ({count},)")
    return tuple(array.tolist())


def finite_vector(name: str, values: object) -> Vector:
    """Return three finite numbers below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    x, y, z = finite_numbers(name, values, 3)
    return (x, y, z)


def positive_numbers(name: str, values: object, count: int) -> tuple[float, ...]:
    """Return `count` positive numbers below `MAX_MAGNITUDE`; raise ArgumentError for anything else."""
    numbers = finite_numbers(name, values, count)
    for index, number in enumerate(numbers):
        if number <= 0.0:
            raise ArgumentError(f"{name}[{index}] is {number}; wanted a positive number")
    return numbers


def colour(name: str, values: object) -> tuple[float, float, float, float]:
    """Return red, green, blue and opacity, each from 0 to 1; raise ArgumentError for anything else."""
    red, green, blue, opacity = numbers = finite_numbers(name, values, 4)
    for index, number in enumerate(numbers):
        if not 0.0 <= number <= 1.0:
            raise ArgumentError(f"{name}[{index}] is {number}; wanted a number from 0 to 1")
    return (red, green, blue, opacity)
