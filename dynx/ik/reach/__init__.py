"""Proofs that a target is out of reach: bounds on distances and angles that hold at every configuration."""

from dynx.ik.reach.proof import proof_of, proofs

__all__ = ["proof_of", "proofs"]
