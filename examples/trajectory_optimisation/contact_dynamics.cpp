// Crocoddyl's forward dynamics with contacts, computed by psdmc's C package: a Python module with one class.
//
// The class takes the same models as crocoddyl.DifferentialActionModelContactFwdDynamics: state, actuation, contacts and
// costs. Contacts are point contacts with the names of the package's contacts, in LOCAL_WORLD_ALIGNED axes. All of them have
// equal gains. A contact that is not active in the model is not active in the call. Costs may use contact forces, placements
// of frames and their Jacobians. The Makefile beside this file compiles the module; gait.py uses it.
#include <crocoddyl/multibody/actions/contact-fwddyn.hpp>

#include "point_contacts.hpp"

namespace {

using Model = crocoddyl::DifferentialActionModelContactFwdDynamics;

// Inputs and results of one node. The derivatives are by q, qd, tau and error.
struct Node : crocoddyl::DifferentialActionDataContactFwdDynamics {
    explicit Node(Model *model) : crocoddyl::DifferentialActionDataContactFwdDynamics(model) { tau.setZero(); }

    Vector<NV> tau, qdd;
    Vector<CONTACTS> active;
    Vector<FORCES> error, forces;
    double kp, kd;
    Matrix<CONTACTS, 3> position;
    Matrix<3 * CONTACTS, 3> rotation;
    Matrix<FORCES, NV> J;
    Matrix<NV, NV> qdd_q, qdd_qd, qdd_tau;
    Matrix<NV, FORCES> qdd_error;
    Matrix<FORCES, NV> forces_q, forces_qd, forces_tau;
    Matrix<FORCES, FORCES> forces_error;
    std::vector<crocoddyl::ContactDataAbstract *> contacts;  // in the package's order
};

void check(int status, const char *function)
{
    if (status) throw std::runtime_error(std::string(function) + ": the active contacts are redundant");
}

class ContactDynamics : public Model {
  public:
    ContactDynamics(std::shared_ptr<crocoddyl::StateMultibody> state, std::shared_ptr<crocoddyl::ActuationModelAbstract> actuation,
                    std::shared_ptr<crocoddyl::ContactModelMultiple> contacts, std::shared_ptr<crocoddyl::CostModelSum> costs)
        : Model(state, actuation, contacts, costs, 0.0, true), pinocchio_(*state->get_pinocchio()), feet_(feet_of(*state, *actuation, *contacts))
    {
        for (const Foot &foot : feet_)
            if (foot.point->get_gains() != feet_[0].point->get_gains()) throw std::invalid_argument("the contacts have different gains");
    }

    Handle createData() override
    {
        auto node = std::make_shared<Node>(this);
        for (int k = 0; k < CONTACTS; k++) node->contacts.push_back(node->multibody.contacts->contacts.at(robot_frame_names[k]).get());
        return node;
    }

    // Accelerations, forces and cost.
    void calc(const Handle &data, const Given &x, const Given &u) override
    {
        Node &node = static_cast<Node &>(*data);
        const double *q = x.data(), *qd = q + NQ, mu = 0.0;
        pinocchio::forwardKinematics(pinocchio_, node.pinocchio, x.head<NQ>(), x.tail<NV>());
        robot_forward_kinematics(q, node.position.data(), node.rotation.data());
        node.tau.tail<JOINTS>() = u;
        node.kp = feet_[0].point->get_gains()[0], node.kd = feet_[0].point->get_gains()[1];
        for (int k = 0; k < CONTACTS; k++) {
            node.active[k] = feet_[k].item->active;
            node.error.segment<3>(3 * k) = node.position.row(k).transpose() - feet_[k].point->get_reference();
        }
        check(robot_constrained_forward_dynamics(q, qd, node.tau.data(), node.active.data(), &mu, &node.kp, &node.kd, node.error.data(),
                                                 node.qdd.data(), node.forces.data()), "constrained_forward_dynamics");
        node.xout = node.qdd;
        for (int k = 0; k < CONTACTS; k++) node.contacts[k]->f.linear() = node.forces.segment<3>(3 * k);
        get_costs()->calc(node.costs, x, u);
        node.cost = node.costs->cost;
    }

    // Their derivatives. As error is a function of q, the derivatives by q get a part from those by error.
    void calcDiff(const Handle &data, const Given &x, const Given &u) override
    {
        Node &node = static_cast<Node &>(*data);
        const double *q = x.data(), *qd = q + NQ, mu = 0.0;
        pinocchio::computeJointJacobians(pinocchio_, node.pinocchio);
        robot_contact_jacobian(q, node.J.data());
        check(robot_constrained_forward_dynamics_derivatives(
                  q, qd, node.tau.data(), node.active.data(), &mu, &node.kp, &node.kd, node.error.data(), node.qdd.data(), node.forces.data(),
                  node.qdd_q.data(), node.qdd_qd.data(), node.qdd_tau.data(), node.qdd_error.data(), node.forces_q.data(),
                  node.forces_qd.data(), node.forces_tau.data(), node.forces_error.data()), "constrained_forward_dynamics_derivatives");
        if (node.kp != 0.0) {
            node.qdd_q.noalias() += node.qdd_error * node.J;
            node.forces_q.noalias() += node.forces_error * node.J;
        }
        node.Fx << node.qdd_q, node.qdd_qd;
        node.Fu = node.qdd_tau.rightCols<JOINTS>();
        for (int k = 0; k < CONTACTS; k++) {
            crocoddyl::ContactDataAbstract &contact = *node.contacts[k];
            contact.df_dx << node.forces_q.middleRows<3>(3 * k), node.forces_qd.middleRows<3>(3 * k);
            contact.df_du = node.forces_tau.block<3, JOINTS>(3 * k, ROOT);
        }
        get_costs()->calcDiff(node.costs, x, u);
    }

    // The last node has costs of the state alone.
    using Model::calc;
    using Model::calcDiff;

  private:
    const pinocchio::Model &pinocchio_;
    const std::vector<Foot> feet_;
};

}  // namespace

BOOST_PYTHON_MODULE(contact_dynamics)
{
    namespace py = boost::python;
    py::import("crocoddyl");
    py::class_<Node, py::bases<crocoddyl::DifferentialActionDataContactFwdDynamics>, std::shared_ptr<Node>, boost::noncopyable>(
        "Node", "Data of a node.", py::no_init);
    py::class_<ContactDynamics, py::bases<Model>, std::shared_ptr<ContactDynamics>, boost::noncopyable>(
        "ContactDynamics", "Forward dynamics with contacts by psdmc.",
        py::init<std::shared_ptr<crocoddyl::StateMultibody>, std::shared_ptr<crocoddyl::ActuationModelAbstract>,
                 std::shared_ptr<crocoddyl::ContactModelMultiple>, std::shared_ptr<crocoddyl::CostModelSum>>());
}
