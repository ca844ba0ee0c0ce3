/* Computed torque for an arm that does not know its load, but finds it while it moves. */
#ifndef PICK_UP_H
#define PICK_UP_H

/* largest_mass in kg, reach in m, tau_sd in N m (N): bounds of the load, and the error of each joint's torque. */
void start(double largest_mass, double reach, const double *tau_sd);

/* Torques tau for the wanted positions, rates and accelerations (3 x DOF), from measured q and qd, dt (s) after the last
   call; seen gets the load's estimated mass and its standard deviation (kg). Returns the status of the estimator. */
int control(double kp, double kd, const double *wanted, const double *q, const double *qd, double dt, double *tau,
            double *seen);

#endif
