// Pinocchio on a floating anymal_b timed by hand, sharing no code with the bench. benchmarks/by_hand_anymal.sh compiles and
// runs it on what Pinocchio's own reading of the URDF says in numbers: the wheel has no headers of the parser.
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "by_hand_timing.hpp"

pinocchio::JointIndex add(pinocchio::Model &model, std::size_t parent, const std::string &type, const pinocchio::SE3 &at,
                          const std::string &name) {
  if (type == "JointModelFreeFlyer") return model.addJoint(parent, pinocchio::JointModelFreeFlyer(), at, name);
  if (type == "JointModelRX") return model.addJoint(parent, pinocchio::JointModelRX(), at, name);
  if (type == "JointModelRY") return model.addJoint(parent, pinocchio::JointModelRY(), at, name);
  if (type == "JointModelRZ") return model.addJoint(parent, pinocchio::JointModelRZ(), at, name);
  throw std::invalid_argument(type);
}

/// A line a joint: type, parent, rotation row by row, translation, mass, centre of mass, inertia about it row by row.
pinocchio::Model robot(const char *file) {
  std::ifstream text(file);
  pinocchio::Model model;
  std::string type;
  std::size_t parent;
  while (text >> type >> parent) {
    pinocchio::SE3 at;
    Eigen::Matrix3d inertia;
    Eigen::Vector3d centre;
    double mass;
    for (int k = 0; k < 9; ++k) text >> at.rotation()(k / 3, k % 3);
    for (int k = 0; k < 3; ++k) text >> at.translation()(k);
    text >> mass;
    for (int k = 0; k < 3; ++k) text >> centre(k);
    for (int k = 0; k < 9; ++k) text >> inertia(k / 3, k % 3);
    const auto joint = add(model, parent, type, at, "joint" + std::to_string(model.njoints));
    model.inertias[joint] = pinocchio::Inertia(mass, centre, inertia);
  }
  return model;
}

int main(int, char **arguments) {
  using namespace pinocchio;
  const Model model = robot(arguments[1]);
  Data data(model);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> within(-1.5, 1.5);
  std::vector<Eigen::VectorXd> q(states), qd(states), x(states);
  for (int i = 0; i < states; ++i) {
    q[i] = Eigen::VectorXd::NullaryExpr(model.nq, [&] { return within(random); });
    q[i].segment<4>(3).normalize();
    for (auto *v : {&qd[i], &x[i]}) *v = Eigen::VectorXd::NullaryExpr(model.nv, [&] { return within(random); });
  }
  double check = 0;
  report("inverse_dynamics", [&](int i) { check += rnea(model, data, q[i], qd[i], x[i])[0]; });
  report("forward_dynamics (world)", [&](int i) { check += aba(model, data, q[i], qd[i], x[i], Convention::WORLD)[0]; });
  report("forward_dynamics (local)", [&](int i) { check += aba(model, data, q[i], qd[i], x[i], Convention::LOCAL)[0]; });
  report("mass_matrix (world)", [&](int i) { check += crba(model, data, q[i], Convention::WORLD)(0, 0); });
  report("mass_matrix (local)", [&](int i) { check += crba(model, data, q[i], Convention::LOCAL)(0, 0); });
  return check == 0;
}
