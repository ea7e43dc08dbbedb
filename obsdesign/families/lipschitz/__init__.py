"""Observers of Lipschitz systems, Abbaszadeh and Marquez (2010)."""
