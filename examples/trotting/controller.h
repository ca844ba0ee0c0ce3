/* A whole-body controller that makes a quadruped trot in place, to be called at a fixed rate with what was just measured.

   Every call computes accelerations of all 18 rates, forces at the four feet, and torques, by one of two methods. The
   quadratic programme keeps forces within friction pyramids and torques within limits. Contact-consistent inverse dynamics
   solves equations alone. Nothing allocates or blocks. SI units; the world's z is up, and the floor is z = 0. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

enum { POSITIONS = 19, RATES = 18, ROOT = 6, JOINTS = 12, FEET = 4, FORCES = 3 * FEET };

/* q = position, quaternion (x y z w) and joints; v = the base's linear and angular velocity along its own axes, and joints. */
struct measurement {
    double time;
    const double *q, *v;
};

struct command {
    double tau[JOINTS];        /* N m, within the package's robot_effort_limit */
    double acceleration[RATES];
    double force[FORCES];      /* N, on the feet, along the world's axes: what the method counts on */
    int stance[FEET];          /* whether the gait has the foot on the floor */
    double qp_seconds;         /* CPU time, from the first of the QP's numbers to its solution; 0 without QP */
    double whole_seconds;      /* CPU time of the whole call */
    int iterations;
    int solved;                /* 0: the torques are those of the call before */
};

enum { BY_PROGRAMME, BY_CONTACTS };

/* Begins with all feet on the floor where they are; the base is to stay where it is. 0, or -1 where
   the package's frames are not left fore, right fore, left hind, right hind foot: LF..., RF..., LH..., RH... */
int trot_begin(const double *q, int method);

/* The torques from now on. */
void trot_step(struct measurement measured, struct command *command);

/* The QP of the last call, for tests: rows (ROWS x COLUMNS) and what they lie between. */
enum { COLUMNS = RATES + FORCES, ROWS = ROOT + 3 * FEET + 5 * FEET + JOINTS };
void trot_problem(double *A, double *lower, double *upper);

#endif
