#define _POSIX_C_SOURCE 199309L
#include "controller.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include <osqp.h>
#include <robot/robot.h>

#include "consistent.h"
#include "gait.h"
#include "qp_pattern.h"
#include "qp_workspace.h"

#if robot_NQ != 19 || robot_NV != 18 || robot_FRAMES != 4
#error "the package is not of a quadruped on a free root with four named feet"
#endif

#define FRICTION 0.5        /* of the floor, as the controller believes; the driver's floor has more */
#define MOST_WEIGHT 2.0     /* largest vertical force of a foot, of the robot's whole weight */
#define BASE_STIFF 60.0     /* 1/s^2 and 1/s: how the base is called back */
#define BASE_DAMP 12.0
#define SWING_STIFF 900.0   /* of a foot in the air */
#define SWING_DAMP 60.0
#define STANCE_DAMP 50.0    /* 1/s: a foot on the floor that moves is stopped */
#define AHEAD 0.12          /* s: a foot lands where the base will be so much later, half of the time on the floor */

enum { BASE_ROWS = 0, FOOT_ROWS = ROOT, CONE_ROWS = FOOT_ROWS + FORCES, LOAD_ROWS = CONE_ROWS + 4 * FEET, TORQUE_ROWS = LOAD_ROWS + FEET };

typedef double Matrix[ROWS][COLUMNS];

static struct {
    int method;
    double base[3], turn[4];          /* where the base is to be */
    double offset[FEET][2];           /* of the feet from the base, along the world's x and y */
    double floor[FEET];               /* z of a foot's frame on the floor */
    struct foot feet[FEET];
    double force_unit;                /* N: the QP's forces are multiples of it */
    double tau[JOINTS], x[COLUMNS];   /* torques and the QP's solution of the last call that had one */
    Matrix A;
    double gradient[COLUMNS], lower[ROWS], upper[ROWS];
} self;

/* CPU time of this thread: what other programs on the machine take is not counted. */
static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Rows of the rotation from the base's axes to the world's. */
static void rotation(const double *quaternion, double R[3][3])
{
    const double x = quaternion[0], y = quaternion[1], z = quaternion[2], w = quaternion[3];
    const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                               {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                               {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    memcpy(R, rows, sizeof rows);
}

int trot_begin(const double *q, int method)
{
    static const char *const ends[FEET] = {"LF", "RF", "LH", "RH"};
    for (int k = 0; k < FEET; k++)
        if (strncmp(robot_frame_names[k], ends[k], 2) != 0) return -1;
    double position[FEET][3], turns[FEET][3][3], M[RATES][RATES];
    robot_forward_kinematics(q, &position[0][0], &turns[0][0][0]);
    robot_mass_matrix(q, &M[0][0]);
    memset(&self, 0, sizeof self);
    self.method = method;
    memcpy(self.base, q, sizeof self.base);
    memcpy(self.turn, q + 3, sizeof self.turn);
    self.force_unit = M[0][0] * fabs(robot_gravity_acceleration[2]) / FEET;
    for (int k = 0; k < FEET; k++) {
        self.offset[k][0] = position[k][0] - q[0], self.offset[k][1] = position[k][1] - q[1];
        self.floor[k] = position[k][2];
        self.feet[k].on_floor = 1;
        memcpy(self.feet[k].lift_off, position[k], sizeof position[k]);
    }
    osqp_cold_start(&qp_solver);
    return 0;
}

/* What the base's rates should do: a spring and a damper to where it is to be, along its own axes. */
static void base_acceleration(struct measurement measured, double R[3][3], double *wanted)
{
    const double *q = measured.q, *v = measured.v, *p = q + 3, *r = self.turn;
    /* The turn from here to there, about the base's own axes: twice the vector part of the short way. */
    const double turn[3] = {-p[0] * r[3] + p[3] * r[0] - p[1] * r[2] + p[2] * r[1], -p[1] * r[3] + p[3] * r[1] - p[2] * r[0] + p[0] * r[2],
                            -p[2] * r[3] + p[3] * r[2] - p[0] * r[1] + p[1] * r[0]};
    const double cosine = p[0] * r[0] + p[1] * r[1] + p[2] * r[2] + p[3] * r[3], shorter = cosine < 0.0 ? -2.0 : 2.0;
    for (int i = 0; i < 3; i++) {
        double away = 0.0;
        for (int j = 0; j < 3; j++) away += R[j][i] * (self.base[j] - q[j]);
        const double *w = v + 3;
        const double bend = w[(i + 1) % 3] * v[(i + 2) % 3] - w[(i + 2) % 3] * v[(i + 1) % 3];
        wanted[i] = BASE_STIFF * away - BASE_DAMP * v[i] - bend;
        wanted[3 + i] = BASE_STIFF * shorter * turn[i] - BASE_DAMP * w[i];
    }
}

/* What a foot's frame should accelerate by, in the world. */
static void foot_acceleration(int k, struct measurement measured, double R[3][3], const struct dynamics *now, double *wanted)
{
    struct foot *foot = &self.feet[k];
    const double *position = now->position[k];
    double velocity[3] = {0.0, 0.0, 0.0}, share;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < RATES; j++) velocity[i] += now->J[k][i][j] * measured.v[j];
    const int down = is_on_floor(k, measured.time, &share);
    if (foot->on_floor && !down) memcpy(foot->lift_off, position, sizeof foot->lift_off);
    foot->on_floor = down;
    if (down) {
        for (int i = 0; i < 3; i++) wanted[i] = -STANCE_DAMP * velocity[i];
        return;
    }
    double target[3] = {0.0, 0.0, self.floor[k]};
    for (int i = 0; i < 2; i++) {
        double drifting = 0.0;
        for (int j = 0; j < 3; j++) drifting += R[i][j] * measured.v[j];
        target[i] = measured.q[i] + self.offset[k][i] + AHEAD * drifting;
    }
    struct step step;
    in_flight(foot, target, share, &step);
    for (int i = 0; i < 3; i++)
        wanted[i] = step.acceleration[i] + SWING_STIFF * (step.position[i] - position[i]) + SWING_DAMP * (step.velocity[i] - velocity[i]);
}

static void between(int row, double lower, double upper)
{
    self.lower[row] = lower;
    self.upper[row] = upper;
}

/* M qdd - J^T f + h: zero in the base's rows, and torques within the joints' limits in the others. */
static void dynamics_rows(const struct dynamics *now)
{
    for (int i = 0; i < RATES; i++) {
        const int row = i < ROOT ? BASE_ROWS + i : TORQUE_ROWS + i - ROOT;
        memcpy(self.A[row], now->M[i], sizeof now->M[i]);
        for (int k = 0; k < FEET; k++)
            for (int axis = 0; axis < 3; axis++) self.A[row][RATES + 3 * k + axis] = -self.force_unit * now->J[k][axis][i];
        const double most = i < ROOT ? 0.0 : robot_effort_limit[1 + i - ROOT];
        between(row, -most - now->h[i], most - now->h[i]);
    }
}

/* J qdd = what the foot should accelerate by, less the drift. */
static void foot_rows(int k, const double *wanted, const struct dynamics *now)
{
    for (int axis = 0; axis < 3; axis++) {
        const int row = FOOT_ROWS + 3 * k + axis;
        memcpy(self.A[row], now->J[k][axis], sizeof now->J[k][axis]);
        between(row, wanted[axis] - now->drift[k][axis], wanted[axis] - now->drift[k][axis]);
    }
}

/* A pyramid in the cone of friction, and no force on a foot in the air. */
static void force_rows(int k)
{
    const int x = RATES + 3 * k, z = x + 2;
    for (int axis = 0; axis < 2; axis++) {
        const int row = CONE_ROWS + 4 * k + 2 * axis;
        self.A[row][x + axis] = 1.0, self.A[row][z] = -FRICTION;
        self.A[row + 1][x + axis] = 1.0, self.A[row + 1][z] = FRICTION;
        between(row, -OSQP_INFTY, 0.0);
        between(row + 1, 0.0, OSQP_INFTY);
    }
    self.A[LOAD_ROWS + k][z] = 1.0;
    between(LOAD_ROWS + k, 0.0, self.feet[k].on_floor ? MOST_WEIGHT * FEET : 0.0);
}

/* The new numbers into OSQP's workspace, and its solution into self.x. */
static int solved(int *iterations)
{
    OSQPFloat values[QP_ENTRIES];
    *iterations = 0;
    for (int k = 0; k < QP_ENTRIES; k++) values[k] = self.A[qp_rows[k]][qp_columns[k]];
    if (osqp_update_data_mat(&qp_solver, OSQP_NULL, OSQP_NULL, 0, values, OSQP_NULL, QP_ENTRIES)) return 0;
    if (osqp_update_data_vec(&qp_solver, self.gradient, self.lower, self.upper)) return 0;
    if (osqp_solve(&qp_solver)) return 0;
    *iterations = (int)qp_solver.info->iter;
    if (qp_solver.info->status_val != OSQP_SOLVED) return 0;
    memcpy(self.x, qp_solver.solution->x, sizeof self.x);
    return 1;
}

/* The torques that the accelerations and forces need. */
static void torques(const struct dynamics *now)
{
    for (int i = 0; i < JOINTS; i++) {
        const double most = robot_effort_limit[1 + i];
        double tau = now->h[ROOT + i];
        for (int j = 0; j < COLUMNS; j++) tau += self.A[TORQUE_ROWS + i][j] * self.x[j];
        self.tau[i] = fmin(fmax(tau, -most), most);
    }
}

/* Torques, accelerations and forces by the quadratic programme. */
static void by_programme(const struct dynamics *now, const double *base, double feet[FEET][3], struct command *command)
{
    for (int i = 0; i < ROOT; i++) self.gradient[i] = -qp_weights[i] * base[i];
    dynamics_rows(now);
    for (int k = 0; k < FEET; k++) {
        foot_rows(k, feet[k], now);
        force_rows(k);
    }
    const double begin = seconds();
    command->solved = solved(&command->iterations);
    command->qp_seconds = seconds() - begin;
    if (command->solved) torques(now);
    memcpy(command->acceleration, self.x, sizeof command->acceleration);
    for (int i = 0; i < FORCES; i++) command->force[i] = self.force_unit * self.x[RATES + i];
}

/* The same by contact-consistent inverse dynamics, which knows no limits. */
static void by_contacts(struct measurement measured, const struct dynamics *now, const double *base, double feet[FEET][3],
                        struct command *command)
{
    double active[FEET], tau[RATES];
    for (int k = 0; k < FEET; k++) active[k] = self.feet[k].on_floor;
    command->qp_seconds = 0.0, command->iterations = 0;
    command->solved = consistent(measured, now, base, feet, active, command->acceleration, tau, command->force) == 0;
    if (!command->solved) return;
    for (int i = 0; i < JOINTS; i++) self.tau[i] = fmin(fmax(tau[ROOT + i], -robot_effort_limit[1 + i]), robot_effort_limit[1 + i]);
}

void trot_step(struct measurement measured, struct command *command)
{
    const double start = seconds();
    struct dynamics now;
    double R[3][3], turns[FEET][3][3], base[ROOT], feet[FEET][3];
    rotation(measured.q + 3, R);
    robot_mass_matrix(measured.q, &now.M[0][0]);
    robot_forward_kinematics(measured.q, &now.position[0][0], &turns[0][0][0]);
    robot_frame_jacobian(measured.q, &now.J[0][0][0]);
    robot_jacobian_dot_qd(measured.q, measured.v, &now.drift[0][0]);

    base_acceleration(measured, R, base);
    for (int k = 0; k < FEET; k++) {
        foot_acceleration(k, measured, R, &now, feet[k]);
        command->stance[k] = self.feet[k].on_floor;
    }
    if (self.method == BY_CONTACTS) {
        by_contacts(measured, &now, base, feet, command);
    } else {
        robot_nonlinear_effects(measured.q, measured.v, now.h);
        by_programme(&now, base, feet, command);
    }
    memcpy(command->tau, self.tau, sizeof self.tau);
    command->whole_seconds = seconds() - start;
}

void trot_problem(double *A, double *lower, double *upper)
{
    memcpy(A, self.A, sizeof self.A);
    memcpy(lower, self.lower, sizeof self.lower);
    memcpy(upper, self.upper, sizeof self.upper);
}
