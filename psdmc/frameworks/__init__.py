"""Compiled robots inside array frameworks that differentiate: JAX and PyTorch."""
