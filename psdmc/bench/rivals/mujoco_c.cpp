// MuJoCo's chain for inverse dynamics: kinematics, velocities, recursive Newton-Euler; no contacts, no sensors.
#include "loops.hpp"

#include <mujoco/mujoco.h>

#include <cstring>

namespace {

mjModel *model = nullptr;
mjData *data = nullptr;

void move_to(const double *q, const double *qd, const double *qdd) {
  std::memcpy(data->qpos, q, sizeof(double) * std::size_t(model->nq));
  std::memcpy(data->qvel, qd, sizeof(double) * std::size_t(model->nv));
  std::memcpy(data->qacc, qdd, sizeof(double) * std::size_t(model->nv));
  mj_kinematics(model, data);
  mj_comPos(model, data);
}

void inverse_dynamics(const double *q, const double *qd, const double *qdd, double *tau) {
  move_to(q, qd, qdd);
  mj_comVel(model, data);
  mj_rne(model, data, 1, tau);
}

void nonlinear_effects(const double *q, const double *qd, const double *qdd, double *h) {
  move_to(q, qd, qdd);
  mj_comVel(model, data);
  mj_rne(model, data, 0, h);
}

}  // namespace

/// MJCF text; 0 where MuJoCo refuses it.
PSDMC_EXPORT int setup(const char *mjcf) {
  mjVFS files;
  mj_defaultVFS(&files);
  mj_addBufferVFS(&files, "robot.xml", mjcf, int(std::strlen(mjcf)));
  char error[512] = "";
  mj_deleteData(data), mj_deleteModel(model);
  model = mj_loadXML("robot.xml", &files, error, sizeof error);
  data = model ? mj_makeData(model) : nullptr;
  mj_deleteVFS(&files);
  return model ? int(model->nv) : 0;
}

PSDMC_CONTESTANT(inverse_dynamics, inverse_dynamics)
PSDMC_CONTESTANT(nonlinear_effects, nonlinear_effects)
