"""A small compiler that knows nothing of robots: array code becomes SIMD machine code for batches.

`trace` runs ordinary array code on symbols; `Kernel` compiles the `Program` that this gives and
evaluates it for many samples at once, one sample in each lane of a vector register. In between:
``expr`` (the graph), ``simplify``, ``program``, ``schedule``, ``emit`` (LLVM IR), ``image`` (machine
code), ``cache`` (machine code kept between processes), ``threads``.
"""
