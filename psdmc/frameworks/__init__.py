"""Functions of compiled robots for JAX and PyTorch, which can differentiate them."""
