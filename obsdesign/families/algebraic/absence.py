"""Refutations of observers without an LMI, proved anew."""

from obsdesign.families.algebraic.claim import refutation as read

__all__ = ["read"]
