#include "controller.h"

#include <stddef.h>

#include <robot/robot.h>

/* An acceleration that takes the joint back to its reference. */
static double correction(struct gains gains, struct reference wanted, struct measurement measured, int joint)
{
    return gains.kp * (wanted.q[joint] - measured.q[joint]) + gains.kd * (wanted.qd[joint] - measured.qd[joint]);
}

static void limit_effort(double *tau)
{
    for (int joint = 0; joint < robot_DOF; joint++) {
        const double most = robot_effort_limit[joint];
        tau[joint] = tau[joint] > most ? most : tau[joint] < -most ? -most : tau[joint];
    }
}

void independent_joints(struct gains gains, const double *inertia, struct reference wanted,
                        struct measurement measured, double *tau)
{
    for (int joint = 0; joint < robot_DOF; joint++) {
        tau[joint] = inertia[joint] * correction(gains, wanted, measured, joint);
    }
    limit_effort(tau);
}

void computed_torque(struct gains gains, const double *theta_b, struct reference wanted, struct measurement measured,
                     double *tau)
{
    double qdd[robot_DOF];
    for (int joint = 0; joint < robot_DOF; joint++) {
        qdd[joint] = wanted.qdd[joint] + correction(gains, wanted, measured, joint);
    }
    if (theta_b != NULL) {
        robot_inverse_dynamics_theta(measured.q, measured.qd, qdd, theta_b, tau);
    } else {
        robot_inverse_dynamics(measured.q, measured.qd, qdd, tau);
    }
    limit_effort(tau);
}

void joint_inertias(const double *q, double *inertia)
{
    double M[robot_DOF * robot_DOF];
    robot_mass_matrix(q, M);
    for (int joint = 0; joint < robot_DOF; joint++) {
        inertia[joint] = M[joint * robot_DOF + joint];
    }
}
