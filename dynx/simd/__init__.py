"""A small compiler, independent of robots, from array code to SIMD machine code for batches.

`trace` runs ordinary array code on symbols and returns a `Program`; `Kernel` compiles it and evaluates it for
many samples at once, one sample in each lane of a vector register. The stages in between: ``expr`` (the
expression graph), ``simplify``, ``program``, ``schedule``, ``emit`` (LLVM IR), ``image`` (machine code),
``cache`` (machine code stored between processes), ``threads``.
"""
