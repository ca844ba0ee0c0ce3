#include "gait.h"

#include <math.h>

#define START 0.5      /* s on four feet, before the first step */
#define PERIOD 0.5     /* s from one step of a foot to its next */
#define FLIGHT 0.2     /* s of it that the foot is in the air: twice 0.05 s on four feet are left */
#define HEIGHT 0.07    /* m, half way through the flight */

int is_on_floor(int foot, double time, double *share)
{
    /* Feet 0 and 3, left fore and right hind, begin; 1 and 2 follow half a period later. */
    const double late = foot == 0 || foot == 3 ? 0.0 : 0.5 * PERIOD;
    const double since = time - START - late;
    *share = 1.0;
    if (since < 0.0) return 1;
    const double phase = since - PERIOD * floor(since / PERIOD);
    if (phase >= FLIGHT) return 1;
    *share = phase / FLIGHT;
    return 0;
}

/* A quintic from 0 to 1 that begins and ends at rest: value, first and second derivative by s. */
static void quintic(double s, double *x)
{
    x[0] = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    x[1] = 30.0 * s * s * (1.0 - s) * (1.0 - s);
    x[2] = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s);
}

/* 64 s^3 (1 - s)^3: up to 1 and back, at rest at both ends. */
static void arch(double s, double *x)
{
    const double r = s * (1.0 - s), slope = 1.0 - 2.0 * s;
    x[0] = 64.0 * r * r * r;
    x[1] = 192.0 * r * r * slope;
    x[2] = 384.0 * r * (slope * slope - r);
}

void in_flight(const struct foot *foot, const double *target, double share, struct step *step)
{
    double way[3], up[3];
    quintic(share, way);
    arch(share, up);
    for (int i = 0; i < 3; i++) {
        const double length = target[i] - foot->lift_off[i], high = i == 2 ? HEIGHT : 0.0;
        step->position[i] = foot->lift_off[i] + length * way[0] + high * up[0];
        step->velocity[i] = (length * way[1] + high * up[1]) / FLIGHT;
        step->acceleration[i] = (length * way[2] + high * up[2]) / (FLIGHT * FLIGHT);
    }
}
