"""Families of observers, a folder each."""
