"""Variants: a traced program that is evaluated for every row of a fixed table, with the rows in the lanes."""

from dynx.simd.variants.emission import Variants, emit_variants
from dynx.simd.variants.kernel import BoundVariants, VariantKernel, load_variants

__all__ = ["BoundVariants", "VariantKernel", "Variants", "emit_variants", "load_variants"]
