"""Filters that a user would pick instead, to compare with: nothing is proved of them."""
