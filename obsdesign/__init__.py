"""Certified state observers for nonlinear systems with unknown inputs."""

__version__ = "0.1.0"
