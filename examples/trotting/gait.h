/* When each foot of a trot is on the floor, and where it goes through the air. */
#ifndef GAIT_H
#define GAIT_H

#include "controller.h"

/* What a foot should do now; position, velocity and acceleration in the world, m and s. */
struct step {
    int on_floor;
    double position[3], velocity[3], acceleration[3];
};

/* One foot's memory: where it left the floor, and whether it is on it. */
struct foot {
    double lift_off[3];
    int on_floor;
};

/* Whether foot 0 .. 3 is on the floor at a time, and the share of its flight that is over, 0 .. 1. */
int is_on_floor(int foot, double time, double *share);

/* Where the flight leads at `share` of it: from foot->lift_off to target (x, y), and down to the floor there. */
void in_flight(const struct foot *foot, const double *target, double share, struct step *step);

#endif
