/* Two joint-space controllers for one robot, to be called at a fixed rate with what was just measured.

   All vectors have robot_DOF entries, SI units. Torques are held until the next call, and never exceed the joints'
   effort limits. Nothing allocates, blocks or keeps state: a call takes the same time every time. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

/* What each joint should do now. */
struct reference {
    const double *q, *qd, *qdd;
};

/* What each joint does now. */
struct measurement {
    const double *q, *qd;
};

/* Error dynamics of a joint without disturbance: e'' + kd e' + kp e = 0. */
struct gains {
    double kp, kd;
};

/* tau_i = inertia_i (kp e_i + kd e'_i): every joint on its own, no model but a constant inertia each. */
void independent_joints(struct gains gains, const double *inertia, struct reference wanted,
                        struct measurement measured, double *tau);

/* tau = M(q) (qdd + kd e' + kp e) + h(q, qd): the model turns the robot into n double integrators.
   theta_b: base parameters to use; a null pointer: those that were compiled in. */
void computed_torque(struct gains gains, const double *theta_b, struct reference wanted, struct measurement measured,
                     double *tau);

/* The diagonal of M(q): what each joint feels while the others stand still. */
void joint_inertias(const double *q, double *inertia);

#endif
