"""Equations of an observer without an LMI, as it runs."""

from obsdesign.families.algebraic.claim import Claim, Form
from obsdesign.families.observer import Observer
from obsdesign.spec import Spec


def observer(spec: Spec, form: Form) -> Observer:
    """Observer of a form."""
    return Claim.of(spec, form).scheme.observer
