/* SPDX-License-Identifier: 0BSD */
/* Names, limits and parameters of two_link. */
#include <math.h>

#include "two_link/two_link.h"

const char *const two_link_joint_names[two_link_DOF] = {
    "shoulder",
    "elbow",
};

const char *const two_link_joint_units[two_link_DOF] = {
    "rad",
    "rad",
};

const double two_link_position_lower[two_link_DOF] = {
    -2.9670597283903604,
    -2.9670597283903604,
};

const double two_link_position_upper[two_link_DOF] = {
    2.9670597283903604,
    2.9670597283903604,
};

const double two_link_speed_limit[two_link_DOF] = {
    3.0,
    3.0,
};

const double two_link_acceleration_limit[two_link_DOF] = {
    15.0,
    15.0,
};

const double two_link_effort_limit[two_link_DOF] = {
    (double)INFINITY,
    (double)INFINITY,
};

const double two_link_gravity_acceleration[3] = {
    0.0,
    -9.81,
    0.0,
};

const double two_link_theta_b[two_link_BASE_PARAMETERS] = {
    1.7651515151515147,
    -0.46499999999999997,
    0.8181818181818179,
    -0.30000000000000004,
};

const char *const two_link_base_parameter_equations[two_link_BASE_PARAMETERS] = {
    "m1 + mx1/a1 - mx2/a2",
    "Izz1 + a1 mx1",
    "m2 + mx2/a2",
    "Izz2 + a2 mx2",
};

const char *const two_link_base_parameter_units[two_link_BASE_PARAMETERS] = {
    "kg",
    "kg m^2",
    "kg",
    "kg m^2",
};
