#include "consistent.h"

#include <math.h>

#include <robot/robot.h>

#define MU 1e-8       /* two feet are on one line, whose direction decides which equations depend on the others */
#define NOTHING 1e-16 /* N^2 and N^2 m^2: what the feet cannot exert is rounding alone */

enum { WIDTH = JOINTS + ROOT + 1 };

/* Gauss-Jordan elimination of A X = B, with row pivoting; a row is (A, B), and B becomes X. 0, or -1 if A is singular. */
static int solve(double rows[JOINTS][WIDTH])
{
    for (int k = 0; k < JOINTS; k++) {
        int pivot = k;
        for (int i = k + 1; i < JOINTS; i++)
            if (fabs(rows[i][k]) > fabs(rows[pivot][k])) pivot = i;
        if (!(fabs(rows[pivot][k]) > 1e-9)) return -1;
        for (int j = k; j < WIDTH; j++) {
            const double swapped = rows[k][j];
            rows[k][j] = rows[pivot][j], rows[pivot][j] = swapped;
        }
        for (int j = WIDTH - 1; j >= k; j--) rows[k][j] /= rows[k][k];
        for (int i = 0; i < JOINTS; i++) {
            const double factor = rows[i][k];
            if (i == k || factor == 0.0) continue;
            for (int j = k; j < WIDTH; j++) rows[i][j] -= factor * rows[k][j];
        }
    }
    return 0;
}

/* The joints' accelerations as a function of the base's: J qdd + drift = wanted, solved for the joints. */
static int joints_of_base(const struct dynamics *now, double feet[FEET][3], double joints[JOINTS][WIDTH])
{
    for (int row = 0; row < JOINTS; row++) {
        const int k = row / 3, axis = row % 3;
        for (int j = 0; j < JOINTS; j++) joints[row][j] = now->J[k][axis][ROOT + j];
        for (int j = 0; j < ROOT; j++) joints[row][JOINTS + j] = -now->J[k][axis][j];
        joints[row][JOINTS + ROOT] = feet[k][axis] - now->drift[k][axis];
    }
    return solve(joints);
}

/* The smallest change of the base's acceleration, in m/s^2 and rad/s^2, that needs no `missing` force and moment. They are
   along the one direction in which the feet cannot push. */
static void relieve(const struct dynamics *now, double joints[JOINTS][WIDTH], const double *missing, double *base)
{
    double slope[RATES], size = 0.0, steepness = 0.0;
    for (int j = 0; j < RATES; j++) {
        slope[j] = 0.0;
        for (int i = 0; i < ROOT; i++) slope[j] += missing[i] * now->M[i][j];
    }
    for (int j = 0; j < ROOT; j++) {
        for (int k = 0; k < JOINTS; k++) slope[j] += joints[k][JOINTS + j] * slope[ROOT + k];
        size += missing[j] * missing[j], steepness += slope[j] * slope[j];
    }
    if (size < NOTHING) return;
    for (int j = 0; j < ROOT; j++) base[j] -= slope[j] * size / steepness;
}

int consistent(struct measurement measured, const struct dynamics *now, const double *base, double feet[FEET][3],
               const double *active, double *acceleration, double *tau, double *force)
{
    double joints[JOINTS][WIDTH];
    const double mu = MU;
    if (joints_of_base(now, feet, joints)) return -1;
    for (int i = 0; i < ROOT; i++) acceleration[i] = base[i];
    for (int round = 0;; round++) {
        for (int i = 0; i < JOINTS; i++) {
            acceleration[ROOT + i] = joints[i][JOINTS + ROOT];
            for (int j = 0; j < ROOT; j++) acceleration[ROOT + i] += joints[i][JOINTS + j] * acceleration[j];
        }
        const int status = robot_contact_inverse_dynamics(measured.q, measured.v, acceleration, active, &mu, tau, force);
        if (status || round == 1) return status;
        relieve(now, joints, tau, acceleration);
    }
}
