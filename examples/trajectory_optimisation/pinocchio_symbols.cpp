// Writes Pinocchio's inverse dynamics with contact wrenches, and the feet's poses, as functions of CasADi's symbols: what the
// Python module pinocchio.casadi gives where Pinocchio was built with it. The wheel 'pin' was not.
//
// usage: pinocchio_symbols ROBOT.txt; ROBOT.txt holds a robot (pinocchio_model.hpp), the number of feet, and for each foot its
// joint, rotation and translation. Writes torques.casadi, (q, qd, qdd, wrenches) -> tau, and feet.casadi, q -> positions (a
// row per foot) and rotations (3 rows per foot). Wrenches have a column per foot: a force, then a moment, along its axes.
#include <pinocchio/autodiff/casadi.hpp>

#include <fstream>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio_model.hpp"
#include "serial_joints.hpp"

using casadi::SX;
using Model = pinocchio::ModelTpl<SX, 0, SerialJoints>;
using Data = pinocchio::DataTpl<SX, 0, SerialJoints>;
using Matrix = Eigen::Matrix<SX, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<SX, Eigen::Dynamic, 1>;

struct Foot {
  std::size_t joint;
  Model::SE3 placement;
};

static Foot read_foot(std::istream &text) {
  Foot foot;
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  text >> foot.joint;
  for (int k = 0; k < 9; ++k) text >> rotation(k / 3, k % 3);
  for (int k = 0; k < 3; ++k) text >> translation(k);
  foot.placement = Model::SE3(rotation.cast<SX>(), translation.cast<SX>());
  return foot;
}

static Vector entries(const SX &symbols) {
  Vector found(symbols.numel());
  for (int i = 0; i < found.size(); ++i) found(i) = symbols(i);
  return found;
}

static SX from(const Matrix &matrix) {
  SX found(matrix.rows(), matrix.cols());
  for (int i = 0; i < matrix.rows(); ++i)
    for (int j = 0; j < matrix.cols(); ++j) found(i, j) = matrix(i, j);
  return SX::densify(found);
}

int main(int count, char **arguments) {
  if (count != 2) return 2;
  std::ifstream text(arguments[1]);
  Model model;
  read_model(text, model);
  std::size_t number = 0;
  text >> number;
  std::vector<Foot> feet;
  for (std::size_t k = 0; k < number; ++k) feet.push_back(read_foot(text));

  const SX q = SX::sym("q", model.nq), qd = SX::sym("qd", model.nv), qdd = SX::sym("qdd", model.nv);
  const SX wrenches = SX::sym("wrenches", 6, number);
  std::vector<Model::Force> forces(model.njoints, Model::Force::Zero());
  for (std::size_t k = 0; k < number; ++k)
    forces[feet[k].joint] += feet[k].placement.act(Model::Force(entries(wrenches).segment<6>(6 * k)));
  Data data(model);
  const SX tau = from(pinocchio::rnea(model, data, entries(q), entries(qd), entries(qdd), forces));
  casadi::Function("torques", {q, qd, qdd, wrenches}, {cse(tau)}).save("torques.casadi");

  Matrix positions(number, 3), rotations(3 * number, 3);
  pinocchio::forwardKinematics(model, data, entries(q));
  for (std::size_t k = 0; k < number; ++k) {
    const Model::SE3 placed = data.oMi[feet[k].joint].act(feet[k].placement);
    positions.row(k) = placed.translation().transpose();
    rotations.middleRows(3 * k, 3) = placed.rotation();
  }
  casadi::Function("feet", {q}, {from(positions), from(rotations)}).save("feet.casadi");
  return 0;
}
