// What contact_dynamics.cpp and foot_forces.cpp share: sizes of the emitted package, types, and the package's contacts.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <boost/python.hpp>

#include <crocoddyl/multibody/contacts/contact-3d.hpp>
#include <crocoddyl/multibody/contacts/multiple-contacts.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>

extern "C" {
#include <robot/robot.h>
}

constexpr int NQ = robot_NQ, NV = robot_NV, ROOT = 6, JOINTS = NV - ROOT, CONTACTS = robot_FRAMES, FORCES = 3 * CONTACTS;

using Given = Eigen::Ref<const Eigen::VectorXd>;
using Handle = std::shared_ptr<crocoddyl::DifferentialActionDataAbstract>;
template <int rows>
using Vector = Eigen::Matrix<double, rows, 1>;
template <int rows, int columns>
using Matrix = Eigen::Matrix<double, rows, columns, Eigen::RowMajor>;

// A contact of the package: its model, and whether it is active.
struct Foot {
    const crocoddyl::ContactItem *item;
    std::shared_ptr<crocoddyl::ContactModel3D> point;
    int row;  // of its forces among those of Crocoddyl, which sorts names
};

// The package's contacts in its order. Throws if those of Crocoddyl are others.
inline std::vector<Foot> feet_of(const crocoddyl::StateMultibody &state, const crocoddyl::ActuationModelAbstract &actuation,
                                 const crocoddyl::ContactModelMultiple &contacts)
{
    const auto &given = contacts.get_contacts();
    if (state.get_nq() != NQ || state.get_nv() != NV || actuation.get_nu() != JOINTS || given.size() != CONTACTS)
        throw std::invalid_argument("the package is of a robot with other joints or contacts");
    std::vector<Foot> feet;
    for (const char *name : robot_frame_names) {
        const auto found = given.find(name);
        const auto point = found == given.end() ? nullptr : std::dynamic_pointer_cast<crocoddyl::ContactModel3D>(found->second->contact);
        if (!point || point->get_type() != pinocchio::LOCAL_WORLD_ALIGNED)
            throw std::invalid_argument(std::string(name) + " is not a point contact in LOCAL_WORLD_ALIGNED axes");
        feet.push_back({found->second.get(), point, 3 * static_cast<int>(std::distance(given.begin(), found))});
    }
    return feet;
}
