// The robot as numbers, read into Pinocchio's own model: no parser, and exactly psdmc's snapped placements.
#pragma once

#include <istream>
#include <string>

#include <pinocchio/multibody.hpp>

/// A joint by Pinocchio's short word for its type (JOINTS in psdmc/bench/case.py), added to the model; its number.
template <class Model>
auto add_joint(Model &model, std::size_t parent, const std::string &type, const typename Model::SE3 &placement,
               const std::string &name) {
  using Joints = typename Model::JointCollection;
  if (type == "RZ") return model.addJoint(parent, typename Joints::JointModelRZ(), placement, name);
  if (type == "PZ") return model.addJoint(parent, typename Joints::JointModelPZ(), placement, name);
  return model.addJoint(parent, typename Joints::JointModelFreeFlyer(), placement, name);
}

/// Fills an empty model from the text of robot_as_numbers (psdmc/bench/case.py): n, gravity, then per joint its type,
/// parent, placement, body about the joint frame and drive inertia.
template <class Model>
void read_model(std::istream &text, Model &model) {
  using Scalar = typename Model::Scalar;
  using Placement = typename Model::SE3;
  std::size_t n = 0;
  Eigen::Vector3d gravity;
  text >> n >> gravity.x() >> gravity.y() >> gravity.z();
  Eigen::VectorXd drive(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::string type;
    std::size_t parent = 0;
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    Eigen::Matrix<double, 10, 1> body;
    text >> type >> parent;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) text >> rotation(row, column);
    for (int row = 0; row < 3; ++row) text >> translation(row);
    for (int row = 0; row < 10; ++row) text >> body(row);
    text >> drive(i);
    const Placement placement(rotation.cast<Scalar>(), translation.cast<Scalar>());
    const std::string name = "joint" + std::to_string(i);
    const auto joint = add_joint(model, parent, type, placement, name);
    // A link without a body: FromDynamicParameters would divide by its mass.
    const bool is_empty = body.isZero(0.0);
    model.inertias[joint] = is_empty ? Model::Inertia::Zero() : Model::Inertia::FromDynamicParameters(body.cast<Scalar>());
  }
  for (std::size_t i = 0; i < n; ++i)
    model.armature.segment(model.idx_vs[i + 1], model.nvs[i + 1]).setConstant(Scalar(drive(i)));
  model.gravity.linear(gravity.cast<Scalar>());
}
