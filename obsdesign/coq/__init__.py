"""The guarantee of an observer as a theorem whose proof the kernel of a proof assistant, Coq, checks."""
