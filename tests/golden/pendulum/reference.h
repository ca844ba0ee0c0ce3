/* SPDX-License-Identifier: 0BSD */
/* States and what the functions give there, worked out from the model by Newton-Euler, not by this code: SI units, one
   state per row, matrices row by row. theta_b_given and tau_theta_given belong to the functions that take theta_b. */
#include <math.h>

#define REFERENCE_COUNT 1

static const double theta_b_given[2] = {
    0.25,
    0.5,
};

static const double q_given[REFERENCE_COUNT][1] = {
    {1.5707963267948966},
};

static const double qd_given[REFERENCE_COUNT][1] = {
    {1.5707963267948966},
};

static const double qdd_given[REFERENCE_COUNT][1] = {
    {2.0},
};

static const double tau_given[REFERENCE_COUNT][1] = {
    {5.405},
};

static const double inverse_dynamics_expected[REFERENCE_COUNT][1] = {
    {5.405},
};

static const double inverse_dynamics_theta_expected[REFERENCE_COUNT][1] = {
    {5.405},
};

static const double forward_dynamics_expected[REFERENCE_COUNT][1] = {
    {2.0},
};
