// The robot as numbers, read into Pinocchio's own model: no parser, and exactly psdmc's snapped placements.
#pragma once

#include <istream>
#include <string>

#include <pinocchio/multibody.hpp>

/// Fills an empty model from the text of robot_as_numbers (psdmc/bench/case.py): n, gravity, then per joint its type,
/// parent, placement, body about the joint frame and drive inertia.
template <class Model>
void read_model(std::istream &text, Model &model) {
  using Scalar = typename Model::Scalar;
  using Joints = typename Model::JointCollection;
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
    const auto joint = type == "RZ" ? model.addJoint(parent, typename Joints::JointModelRZ(), placement, name)
                                    : model.addJoint(parent, typename Joints::JointModelPZ(), placement, name);
    // A link without a body: FromDynamicParameters would divide by its mass.
    const bool is_empty = body.isZero(0.0);
    model.inertias[joint] = is_empty ? Model::Inertia::Zero() : Model::Inertia::FromDynamicParameters(body.cast<Scalar>());
  }
  model.armature = drive.cast<Scalar>();
  model.gravity.linear(gravity.cast<Scalar>());
}
