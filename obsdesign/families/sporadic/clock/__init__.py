"""Certificates whose storage function depends on the time that is left to the next measurement."""
