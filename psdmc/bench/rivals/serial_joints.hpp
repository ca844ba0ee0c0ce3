// Pinocchio's models for scalars that record: joints of the benchmark's robots, and nothing to instantiate beside them.
#pragma once

#include <pinocchio/multibody.hpp>

/// The kinds of joint that the benchmark's robots have, instead of Pinocchio's twenty: compiles in a quarter of the time.
template <class Scalar_, int Options_>
struct SerialJoints {
  using Scalar = Scalar_;
  static constexpr int Options = Options_;
  using JointModelRZ = pinocchio::JointModelRevoluteTpl<Scalar, Options, 2>;
  using JointModelPZ = pinocchio::JointModelPrismaticTpl<Scalar, Options, 2>;
  using JointModelFreeFlyer = pinocchio::JointModelFreeFlyerTpl<Scalar, Options>;
  using Mimic = pinocchio::JointModelMimicTpl<Scalar, Options, SerialJoints>;  // Pinocchio asks for it by name
  using MimicData = pinocchio::JointDataMimicTpl<Scalar, Options, SerialJoints>;
  using JointModelVariant = boost::variant<JointModelRZ, JointModelPZ, JointModelFreeFlyer, boost::recursive_wrapper<Mimic>>;
  using JointDataRZ = pinocchio::JointDataRevoluteTpl<Scalar, Options, 2>;
  using JointDataPZ = pinocchio::JointDataPrismaticTpl<Scalar, Options, 2>;
  using JointDataFreeFlyer = pinocchio::JointDataFreeFlyerTpl<Scalar, Options>;
  using JointDataVariant = boost::variant<JointDataRZ, JointDataPZ, JointDataFreeFlyer, boost::recursive_wrapper<MimicData>>;
};
