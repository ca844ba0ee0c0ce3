"""The functions of compiled robots for JAX and PyTorch, which can differentiate these functions."""
