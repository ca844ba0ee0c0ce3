/* A C program that uses an emitted package: torques of one state, and the accelerations that they give back. */
#include <stdio.h>

#include <two_link/two_link.h>

int main(void)
{
    const double q[two_link_DOF] = {0.3, -0.7}, qd[two_link_DOF] = {1.1, 0.4}, qdd[two_link_DOF] = {2.0, -3.0};
    double tau[two_link_DOF], back[two_link_DOF];

    two_link_inverse_dynamics(q, qd, qdd, tau);
    const int failed = two_link_forward_dynamics(q, qd, tau, back);
    if (failed) {
        fprintf(stderr, "the mass matrix is singular at joint %s\n", two_link_joint_names[failed - 1]);
        return 1;
    }
    for (int joint = 0; joint < two_link_DOF; joint++) {
        printf("%s %.17g %.17g\n", two_link_joint_names[joint], tau[joint], back[joint]);
    }
    return 0;
}
