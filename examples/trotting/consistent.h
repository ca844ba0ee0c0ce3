/* Contact-consistent inverse dynamics: the torques that move base and feet as wanted, without inequalities. */
#ifndef CONSISTENT_H
#define CONSISTENT_H

#include "controller.h"

/* The dynamics of one state, from the package. */
struct dynamics {
    double M[RATES][RATES], h[RATES], J[FEET][6][RATES], drift[FEET][6], position[FEET][3];
};

/* Accelerations, torques (those of the base are zero) and forces on the feet (N, along the world's axes).

   The feet accelerate as wanted. The base does so as far as the feet on the floor (active = 1) can push it, of which there
   are two or more: two feet exert no moment about the line between them. If several forces do the same, they have the
   smallest norm. Returns 0, or another number if a leg is singular. */
int consistent(struct measurement measured, const struct dynamics *now, const double *base, double feet[FEET][3],
               const double *active, double *acceleration, double *tau, double *force);

#endif
