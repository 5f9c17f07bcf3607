"""Rigid-body algorithms, each written once and generic in the scalar type.

The code never branches on a computed value and never assigns into a float array. Evaluated on float64 it is
the backend `reference`; evaluated on 50-digit numbers, it is the referee of `dynx.agreement`; traced on
symbols, it is the source of the compiled kernels.
"""
