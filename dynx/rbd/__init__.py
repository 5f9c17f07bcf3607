"""The textbook algorithms, each written once, generic in the scalar.

Plain array code that branches on no value and writes into no float array: evaluated on float64 it
is the backend `reference`, on 50-digit numbers the referee of `dynx.agreement`.
"""
