// Pinocchio on the KR6 timed by hand, sharing no code with the bench. benchmarks/by_hand.sh compiles and runs it.
#include <random>
#include <string>
#include <vector>

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "by_hand_timing.hpp"

constexpr int joints = 6;

/// Rows of examples/robots/kr6.toml: a and d in m, alpha in quarter turns.
constexpr double dh[joints][3] = {{0.025, -1, 0.183}, {-0.315, 0, 0}, {-0.035, 1, 0}, {0, -1, 0.365}, {0, 1, 0}, {0, 0, 0.08}};

pinocchio::Model arm() {
  pinocchio::Model model;
  pinocchio::SE3 link_before = pinocchio::SE3::Identity();
  for (int i = 0; i < joints; ++i) {
    const auto joint = model.addJoint(i, pinocchio::JointModelRZ(), link_before, "joint" + std::to_string(i));
    const auto turn = Eigen::AngleAxisd(dh[i][1] * M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
    link_before = pinocchio::SE3(turn, Eigen::Vector3d(dh[i][0], 0, dh[i][2]));
    model.inertias[joint] = pinocchio::Inertia::Random();
  }
  return model;
}

int main() {
  using namespace pinocchio;
  const Model model = arm();
  Data data(model);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> within(-3, 3);
  std::vector<Eigen::VectorXd> q(states), qd(states), x(states);
  for (int i = 0; i < states; ++i) {
    for (auto *v : {&q[i], &qd[i], &x[i]}) *v = Eigen::VectorXd::NullaryExpr(joints, [&] { return within(random); });
  }
  double check = 0;
  report("inverse_dynamics", [&](int i) { check += rnea(model, data, q[i], qd[i], x[i])[0]; });
  report("forward_dynamics (world)", [&](int i) { check += aba(model, data, q[i], qd[i], x[i], Convention::WORLD)[0]; });
  report("forward_dynamics (local)", [&](int i) { check += aba(model, data, q[i], qd[i], x[i], Convention::LOCAL)[0]; });
  report("mass_matrix (world)", [&](int i) { check += crba(model, data, q[i], Convention::WORLD)(0, 0); });
  report("mass_matrix (local)", [&](int i) { check += crba(model, data, q[i], Convention::LOCAL)(0, 0); });
  report("regressor", [&](int i) { check += computeJointTorqueRegressor(model, data, q[i], qd[i], x[i])(0, 9); });
  report("inverse derivatives", [&](int i) {
    computeRNEADerivatives(model, data, q[i], qd[i], x[i]);
    check += data.dtau_dq(0, 1);
  });
  report("forward derivatives", [&](int i) {
    computeABADerivatives(model, data, q[i], qd[i], x[i]);
    check += data.ddq_dq(0, 1);
  });
  // No reverse mode: whole matrices, then the cotangent times them.
  Eigen::VectorXd by_q(joints), by_qd(joints), by_x(joints);
  const auto multiplied = [&](const Eigen::MatrixXd &in_q, const Eigen::MatrixXd &in_qd, const Eigen::MatrixXd &in_x, int i) {
    by_q.noalias() = in_q.transpose() * x[i];
    by_qd.noalias() = in_qd.transpose() * x[i];
    by_x.noalias() = in_x.selfadjointView<Eigen::Upper>() * x[i];
    check += by_q[1] + by_qd[1] + by_x[1];
  };
  report("inverse vjp", [&](int i) {
    computeRNEADerivatives(model, data, q[i], qd[i], x[i]);
    multiplied(data.dtau_dq, data.dtau_dv, data.M, i);
  });
  report("forward vjp", [&](int i) {
    computeABADerivatives(model, data, q[i], qd[i], x[i]);
    multiplied(data.ddq_dq, data.ddq_dv, data.Minv, i);
  });
  return check == 0;
}
