"""Observers whose measurements arrive sporadically, Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019)."""
