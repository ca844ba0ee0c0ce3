// Crocoddyl's inverse dynamics with contacts, computed by psdmc's C package: a Python module with one class.
//
// The class takes the same models as crocoddyl.DifferentialActionModelContactInvDynamics. Controls are the accelerations and
// the forces at the feet. Equality constraints say that no torque acts on the base and that active contacts do not move.
// Contacts are point contacts with the names of the package's frames, in LOCAL_WORLD_ALIGNED axes. Costs may use contact
// forces, joint torques, placements of frames and their Jacobians. The Makefile beside this file compiles the module;
// foot_forces.py uses it.
#include <crocoddyl/multibody/actions/contact-invdyn.hpp>

#include "point_contacts.hpp"

namespace {

using Model = crocoddyl::DifferentialActionModelContactInvDynamics;

// Inputs and results of one node. Of the frames' rows, the first three are linear. Boost needs another name than Node,
// which contact_dynamics.cpp has, as a program may load both modules.
struct FeetNode : crocoddyl::DifferentialActionDataContactInvDynamics {
    explicit FeetNode(Model *model) : crocoddyl::DifferentialActionDataContactInvDynamics(model) { wrenches.setZero(); }

    Matrix<CONTACTS, 3> position;
    Matrix<3 * CONTACTS, 3> rotation;
    Matrix<CONTACTS, 6> a, wrenches;
    Matrix<6 * CONTACTS, NV> J, v_q, a_q, a_qd;
    Matrix<NV, 6 * CONTACTS> tau_wrenches;
    std::vector<crocoddyl::ContactDataAbstract *> contacts;  // in the package's order
};

class FootForces : public Model {
  public:
    FootForces(std::shared_ptr<crocoddyl::StateMultibody> state, std::shared_ptr<crocoddyl::ActuationModelAbstract> actuation,
               std::shared_ptr<crocoddyl::ContactModelMultiple> contacts, std::shared_ptr<crocoddyl::CostModelSum> costs)
        : Model(state, actuation, contacts, costs), pinocchio_(*state->get_pinocchio()), feet_(feet_of(*state, *actuation, *contacts))
    {
    }

    Handle createData() override
    {
        auto node = std::make_shared<FeetNode>(this);
        for (const char *name : robot_frame_names) node->contacts.push_back(node->multibody.contacts->contacts.at(name).get());
        return node;
    }

    // Torques, accelerations of the contacts, cost, and what the constraints make of them.
    void calc(const Handle &data, const Given &x, const Given &u) override
    {
        FeetNode &node = static_cast<FeetNode &>(*data);
        const double *q = x.data(), *qd = q + NQ, *qdd = u.data();
        Eigen::VectorXd &tau = node.pinocchio.tau;
        pinocchio::forwardKinematics(pinocchio_, node.pinocchio, x.head<NQ>(), x.tail<NV>());
        robot_forward_kinematics(q, node.position.data(), node.rotation.data());
        robot_frame_jacobian(q, node.J.data());
        robot_frame_acceleration(q, qd, qdd, node.a.data());
        for (int k = 0; k < CONTACTS; k++) {
            crocoddyl::ContactDataAbstract &contact = *node.contacts[k];
            const auto &point = *feet_[k].point;
            const Eigen::Vector3d force = feet_[k].item->active * u.segment<3>(NV + feet_[k].row);
            contact.f.linear() = force;
            node.wrenches.row(k).head<3>() = force.transpose() * node.rotation.middleRows<3>(3 * k);
            contact.a0 = node.a.row(k).head<3>().transpose() + point.get_gains()[1] * node.J.middleRows<3>(6 * k) * x.tail<NV>() +
                         point.get_gains()[0] * (node.position.row(k).transpose() - point.get_reference());
        }
        robot_inverse_dynamics_with_wrenches(q, qd, qdd, node.wrenches.data(), tau.data());
        node.xout = node.multibody.joint->a = u.head<NV>();
        node.multibody.joint->tau = node.multibody.actuation->u = tau.tail<JOINTS>();
        get_costs()->calc(node.costs, x, u);
        node.cost = node.costs->cost;
        for (const std::string &name : get_contacts()->get_active_set()) choose(name, true);
        for (const std::string &name : get_contacts()->get_inactive_set()) choose(name, false);
        node.constraints->resize(this, &node);
        get_constraints()->calc(node.constraints, x, u);
    }

    // Their derivatives. The world's axes turn in the foot, so the derivative of the torques by q has a part from the forces.
    void calcDiff(const Handle &data, const Given &x, const Given &u) override
    {
        FeetNode &node = static_cast<FeetNode &>(*data);
        const double *q = x.data(), *qd = q + NQ, *qdd = u.data();
        auto &by_q = node.pinocchio.dtau_dq;
        pinocchio::computeJointJacobians(pinocchio_, node.pinocchio);
        robot_inverse_dynamics_with_wrenches_derivatives(q, qd, qdd, node.wrenches.data(), by_q.data(), node.pinocchio.dtau_dv.data(),
                                                         node.pinocchio.M.data(), node.tau_wrenches.data());
        robot_frame_acceleration_derivatives(q, qd, qdd, node.a_q.data(), node.a_qd.data(), node.J.data());
        robot_frame_velocity_derivatives(q, qd, node.v_q.data());
        for (int k = 0; k < CONTACTS; k++) {
            crocoddyl::ContactDataAbstract &contact = *node.contacts[k];
            const auto J = node.J.middleRows<3>(6 * k), turn = node.J.middleRows<3>(6 * k + 3);
            const double kp = feet_[k].point->get_gains()[0], kd = feet_[k].point->get_gains()[1];
            auto all = node.multibody.contacts->Jc.middleRows<3>(feet_[k].row);
            if (!feet_[k].item->active) {
                all.setZero();
                continue;
            }
            all = contact.Jc = J;
            contact.da0_dx << node.a_q.middleRows<3>(6 * k) + kd * node.v_q.middleRows<3>(6 * k) + kp * J,
                node.a_qd.middleRows<3>(6 * k) + kd * J;
            by_q.noalias() -= J.transpose() * (pinocchio::skew(contact.f.linear()) * turn);
        }
        auto &joint = *node.multibody.joint;
        joint.dtau_dx << by_q.bottomRows<JOINTS>(), node.pinocchio.dtau_dv.bottomRows<JOINTS>();
        joint.dtau_du << node.pinocchio.M.bottomRows<JOINTS>(), -node.multibody.contacts->Jc.rightCols<JOINTS>().transpose();
        get_costs()->calcDiff(node.costs, x, u);
        get_constraints()->calcDiff(node.constraints, x, u);
    }

    // The last node has costs of the state alone.
    using Model::calc;
    using Model::calcDiff;

  private:
    // An active foot does not move; there is no force at another one.
    void choose(const std::string &foot, bool active)
    {
        get_constraints()->changeConstraintStatus(foot + "_acc", active);
        get_constraints()->changeConstraintStatus(foot + "_force", !active);
    }

    const pinocchio::Model &pinocchio_;
    const std::vector<Foot> feet_;
};

}  // namespace

BOOST_PYTHON_MODULE(foot_forces)
{
    namespace py = boost::python;
    py::import("crocoddyl");
    py::class_<FeetNode, py::bases<crocoddyl::DifferentialActionDataContactInvDynamics>, std::shared_ptr<FeetNode>, boost::noncopyable>(
        "FeetNode", "Data of a node.", py::no_init);
    py::class_<FootForces, py::bases<Model>, std::shared_ptr<FootForces>, boost::noncopyable>(
        "FootForces", "Inverse dynamics with contacts by psdmc.",
        py::init<std::shared_ptr<crocoddyl::StateMultibody>, std::shared_ptr<crocoddyl::ActuationModelAbstract>,
                 std::shared_ptr<crocoddyl::ContactModelMultiple>, std::shared_ptr<crocoddyl::CostModelSum>>());
}
