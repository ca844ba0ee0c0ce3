"""Gradients of forward dynamics with contacts."""

from products_with_slopes import made_for

test_layouts, test_programs, test_joints_of_several_coordinates = made_for("constrained_forward_dynamics_vjp")
