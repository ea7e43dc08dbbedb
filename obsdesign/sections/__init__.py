"""How a section of a spec is written and read, for whoever reads one: a file, a type of nonlinearity, a family.

source.py     the text of a spec, from a file or a stream
document.py   YAML text to nodes with line and column, within safe limits
forms.py      which forms values take, with their JSON Schema; what to say of a word that is not allowed
notation.py   matrices in the notation of MATLAB or numpy, as the lists that a spec has
values.py     entries to exact numbers, matrices and expressions; collects what is wrong
writing.py    Python values to the text of a spec
"""
