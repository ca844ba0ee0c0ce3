/* States and torques worked out from the model, not by this code: SI units, one state per row. */
#define REFERENCE_COUNT 1

static const double reference_q[REFERENCE_COUNT][1] = {
    {0.5},
};

static const double reference_qd[REFERENCE_COUNT][1] = {
    {0.5},
};

static const double reference_qdd[REFERENCE_COUNT][1] = {
    {0.5},
};

static const double reference_tau[REFERENCE_COUNT][1] = {
    {0.5},
};
