"""Gradients of forward dynamics with contacts by theta_b."""

from contact_gradients_by_theta import made_for

test_programs, test_loops_and_contacts_together = made_for("constrained_forward_dynamics")
