"""Observer families, one file each, and what a spec asks of them."""
