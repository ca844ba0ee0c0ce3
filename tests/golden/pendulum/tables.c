/* SPDX-License-Identifier: 0BSD */
/* Names, limits and parameters of pendulum. */
#include <math.h>

#include "pendulum/pendulum.h"

const char *const pendulum_joint_names[pendulum_DOF] = {
    "hinge",
};

const char *const pendulum_joint_units[pendulum_DOF] = {
    "rad",
};

const double pendulum_position_lower[pendulum_DOF] = {
    -3.1,
};

const double pendulum_position_upper[pendulum_DOF] = {
    3.1,
};

const double pendulum_speed_limit[pendulum_DOF] = {
    4.0,
};

const double pendulum_acceleration_limit[pendulum_DOF] = {
    (double)INFINITY,
};

const double pendulum_effort_limit[pendulum_DOF] = {
    (double)INFINITY,
};

const double pendulum_gravity_acceleration[3] = {
    0.0,
    -9.81,
    0.0,
};

const double pendulum_theta_b[pendulum_BASE_PARAMETERS] = {
    0.25,
    0.5,
};

const char *const pendulum_base_parameter_equations[pendulum_BASE_PARAMETERS] = {
    "Izz1 + m1 0.5^2",
    "mx1",
};

const char *const pendulum_base_parameter_units[pendulum_BASE_PARAMETERS] = {
    "kg m^2",
    "kg m",
};
