"""An observer in steps of a period: what runs in a simulation of the implementation, on a log and as exported code.

method.py     a step of Euler, Runge-Kutta or the exact linear part as equations
routine.py    equations in an order in which they can be computed
sharing.py    what is computed more than once, computed once
implemented.py   the routines of an observer: begin, step, flow, jump, estimate
"""
