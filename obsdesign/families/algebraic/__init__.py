"""Observers without an LMI: what is certified of them is algebra (Yi, Ortega and Zhang 2018)."""
