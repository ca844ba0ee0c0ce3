// Pinocchio's C++ algorithms, called as its users call them: one model, one data, Eigen vectors.
//
// Vectors are copied to the output; matrices stay in `data`, where Pinocchio's users read them, unless the harness
// asks for them to check them: the rival is not charged for copies.
#include "loops.hpp"

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <memory>
#include <sstream>

#include "pinocchio_model.hpp"

namespace {

using pinocchio::Convention;

std::unique_ptr<pinocchio::Model> model;
std::unique_ptr<pinocchio::Data> data;
bool copies_matrices = false;

/// A caller's vector as Pinocchio's own instantiations take it: not copied.
using Vector = Eigen::Ref<const Eigen::VectorXd>;

Vector vector(const double *values) { return Eigen::Map<const Eigen::VectorXd>(values, model->nv); }

Vector positions(const double *values) { return Eigen::Map<const Eigen::VectorXd>(values, model->nq); }

void give(const Eigen::VectorXd &from, double *to) { Eigen::Map<Eigen::VectorXd>(to, from.size()) = from; }

template <class Matrix>
void give_matrix(const Matrix &from, double *to) {
  if (!copies_matrices) return;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<RowMajor>(to, from.rows(), from.cols()) = from;
}

void rnea(const double *q, const double *qd, const double *qdd, double *tau) {
  give(pinocchio::rnea(*model, *data, positions(q), vector(qd), vector(qdd)), tau);
}

template <Convention convention>
void aba(const double *q, const double *qd, const double *tau, double *qdd) {
  give(pinocchio::aba(*model, *data, positions(q), vector(qd), vector(tau), convention), qdd);
}

template <Convention convention>
void crba(const double *q, const double *, const double *, double *M) {
  pinocchio::crba(*model, *data, positions(q), convention);
  if (copies_matrices) data->M.triangularView<Eigen::StrictlyLower>() = data->M.transpose();
  give_matrix(data->M, M);
}

void inverse_of_mass_matrix(const double *q, const double *, const double *, double *inverse) {
  pinocchio::computeMinverse(*model, *data, positions(q));
  if (copies_matrices) data->Minv.triangularView<Eigen::StrictlyLower>() = data->Minv.transpose();
  give_matrix(data->Minv, inverse);
}

void nonlinear_effects(const double *q, const double *qd, const double *, double *h) {
  give(pinocchio::nonLinearEffects(*model, *data, positions(q), vector(qd)), h);
}

void gravity(const double *q, const double *, const double *, double *g) {
  give(pinocchio::computeGeneralizedGravity(*model, *data, positions(q)), g);
}

void regressor(const double *q, const double *qd, const double *qdd, double *Y) {
  // Its shipped instantiation, unlike the others', takes vectors that own their memory.
  static Eigen::VectorXd q_, qd_, qdd_;
  q_ = positions(q), qd_ = vector(qd), qdd_ = vector(qdd);
  give_matrix(pinocchio::computeJointTorqueRegressor(*model, *data, q_, qd_, qdd_), Y);
}

/// Matrices behind each other at `to`; the last one's lower triangle is filled first, as Pinocchio leaves it open.
void give_matrices(const Eigen::MatrixXd &by_q, const Eigen::MatrixXd &by_qd, Eigen::MatrixXd last, double *to) {
  last.triangularView<Eigen::StrictlyLower>() = last.transpose();
  for (const auto &matrix : {by_q, by_qd, last}) give_matrix(matrix, to), to += matrix.size();
}

void rnea_derivatives(const double *q, const double *qd, const double *qdd, double *out) {
  pinocchio::computeRNEADerivatives(*model, *data, positions(q), vector(qd), vector(qdd));
  if (copies_matrices) give_matrices(data->dtau_dq, data->dtau_dv, data->M, out);
}

void aba_derivatives(const double *q, const double *qd, const double *tau, double *out) {
  pinocchio::computeABADerivatives(*model, *data, positions(q), vector(qd), vector(tau));
  give(data->ddq, out);
  if (copies_matrices) give_matrices(data->ddq_dq, data->ddq_dv, data->Minv, out + model->nv);
}

/// Pinocchio has no reverse mode: whole matrices, and the cotangent times them.
template <class ByQ, class ByQd, class Last>
void give_products(const ByQ &by_q, const ByQd &by_qd, const Last &last, const double *cotangent, double *to) {
  const auto n = model->nv;
  const Vector weights = vector(cotangent);
  Eigen::Map<Eigen::VectorXd>(to, n).noalias() = by_q.transpose() * weights;
  Eigen::Map<Eigen::VectorXd>(to + n, n).noalias() = by_qd.transpose() * weights;
  Eigen::Map<Eigen::VectorXd>(to + 2 * n, n).noalias() = last.template selfadjointView<Eigen::Upper>() * weights;
}

void rnea_vjp(const double *q, const double *qd, const double *qdd, const double *cotangent, double *out) {
  pinocchio::computeRNEADerivatives(*model, *data, positions(q), vector(qd), vector(qdd));
  give(data->tau, out);
  give_products(data->dtau_dq, data->dtau_dv, data->M, cotangent, out + model->nv);
}

void aba_vjp(const double *q, const double *qd, const double *tau, const double *cotangent, double *out) {
  pinocchio::computeABADerivatives(*model, *data, positions(q), vector(qd), vector(tau));
  give(data->ddq, out);
  give_products(data->ddq_dq, data->ddq_dv, data->Minv, cotangent, out + model->nv);
}

}  // namespace

PSDMC_EXPORT int setup(const char *robot) {
  std::istringstream text(robot);
  model = std::make_unique<pinocchio::Model>();
  read_model(text, *model);
  data = std::make_unique<pinocchio::Data>(*model);
  return int(model->nv);
}

PSDMC_EXPORT void copy_matrices(int yes) { copies_matrices = yes != 0; }

PSDMC_CONTESTANT(inverse_dynamics, rnea)
PSDMC_CONTESTANT(forward_dynamics_local, aba<Convention::LOCAL>)
PSDMC_CONTESTANT(forward_dynamics_world, aba<Convention::WORLD>)
PSDMC_CONTESTANT(mass_matrix_local, crba<Convention::LOCAL>)
PSDMC_CONTESTANT(mass_matrix_world, crba<Convention::WORLD>)
PSDMC_CONTESTANT(mass_matrix_inverse, inverse_of_mass_matrix)
PSDMC_CONTESTANT(nonlinear_effects, nonlinear_effects)
PSDMC_CONTESTANT(gravity, gravity)
PSDMC_CONTESTANT(regressor, regressor)
PSDMC_CONTESTANT(inverse_dynamics_derivatives, rnea_derivatives)
PSDMC_CONTESTANT(forward_dynamics_derivatives, aba_derivatives)
PSDMC_CONTESTANT(inverse_dynamics_vjp, rnea_vjp)
PSDMC_CONTESTANT(forward_dynamics_vjp, aba_vjp)
