// Pinocchio's models for scalars that record: joints that psdmc knows, and nothing to instantiate beside them.
#pragma once

#include <pinocchio/multibody.hpp>

/// The two kinds of joint that psdmc knows, instead of Pinocchio's twenty: compiles in a quarter of the time.
template <class Scalar_, int Options_>
struct SerialJoints {
  using Scalar = Scalar_;
  static constexpr int Options = Options_;
  using JointModelRZ = pinocchio::JointModelRevoluteTpl<Scalar, Options, 2>;
  using JointModelPZ = pinocchio::JointModelPrismaticTpl<Scalar, Options, 2>;
  using Mimic = pinocchio::JointModelMimicTpl<Scalar, Options, SerialJoints>;  // Pinocchio asks for it by name
  using MimicData = pinocchio::JointDataMimicTpl<Scalar, Options, SerialJoints>;
  using JointModelVariant = boost::variant<JointModelRZ, JointModelPZ, boost::recursive_wrapper<Mimic>>;
  using JointDataRZ = pinocchio::JointDataRevoluteTpl<Scalar, Options, 2>;
  using JointDataPZ = pinocchio::JointDataPrismaticTpl<Scalar, Options, 2>;
  using JointDataVariant = boost::variant<JointDataRZ, JointDataPZ, boost::recursive_wrapper<MimicData>>;
};
