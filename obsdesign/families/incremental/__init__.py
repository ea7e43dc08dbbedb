"""Observers with the gains L1 and L2 (families l2 and linf), Corless and Chakrabarty (2019)."""
