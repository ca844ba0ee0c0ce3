#include "pick_up.h"

#include <robot/robot.h>

static robot_estimator estimator;
static double last_tau[robot_DOF];

void start(double largest_mass, double reach, const double *tau_sd)
{
    robot_estimate_init(&estimator, largest_mass, reach, tau_sd);
    for (int joint = 0; joint < robot_DOF; joint++) {
        last_tau[joint] = 0;
    }
}

/* Base parameters of the arm with the load that the estimator has found, once it is sure that there is one. */
static void with_load(double *theta_b, robot_load *load)
{
    robot_estimate_load(&estimator, load);
    for (int k = 0; k < robot_BASE_PARAMETERS; k++) {
        theta_b[k] = robot_theta_b[k];
    }
    if (load->mass > 3 * load->mass_sd) {
        robot_add_payload(load->mass, load->com, NULL, theta_b);
    }
}

int control(double kp, double kd, const double *wanted, const double *q, const double *qd, double dt, double *tau,
            double *seen)
{
    const double *wanted_qd = wanted + robot_DOF, *wanted_qdd = wanted_qd + robot_DOF;
    double theta_b[robot_BASE_PARAMETERS], qdd[robot_DOF];
    robot_load load;
    const int status = robot_estimate_step(&estimator, q, qd, last_tau, dt);
    with_load(theta_b, &load);
    for (int joint = 0; joint < robot_DOF; joint++) {
        qdd[joint] = wanted_qdd[joint] + kp * (wanted[joint] - q[joint]) + kd * (wanted_qd[joint] - qd[joint]);
    }
    robot_inverse_dynamics_theta(q, qd, qdd, theta_b, tau);
    for (int joint = 0; joint < robot_DOF; joint++) {
        last_tau[joint] = tau[joint];
    }
    seen[0] = load.mass;
    seen[1] = load.mass_sd;
    return status;
}
