"""Rigid-body algorithms, each written once and generic in the scalar type.

Plain array code that never branches on a computed value and never assigns into a float array. Evaluated on
float64 it is the backend `reference`; on 50-digit numbers, the referee of `dynx.agreement`; on traced
symbols, the source of the compiled kernels.
"""
