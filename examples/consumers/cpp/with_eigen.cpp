// The raw-pointer forms with Eigen: matrices, maps and blocks that lie in one piece need no copies.
#include <cstdio>

#include <Eigen/Dense>
#include <two_link/two_link.hpp>

using Robot = two_link::Robot;
using Vector = Eigen::Matrix<Robot::Real, Robot::dof, 1>;
using Matrix = Eigen::Matrix<Robot::Real, Robot::dof, Robot::dof, Eigen::RowMajor>;

int main()
{
    const Vector q(0.3, -0.7), qd(1.1, 0.4), qdd(2.0, -3.0);
    Vector tau, bias;
    Matrix M;
    Robot::inverse_dynamics(q.data(), qd.data(), qdd.data(), tau.data());
    Robot::nonlinear_effects(q.data(), qd.data(), bias.data());
    Robot::mass_matrix(q.data(), M.data());

    // What the std::array forms return is mapped, not copied; here a Jacobian, 6 x n.
    const auto J = Robot::jacobian(Robot::Vector{q[0], q[1]});
    const Eigen::Map<const Eigen::Matrix<Robot::Real, 6, Robot::dof, Eigen::RowMajor>> jacobian(J.data());

    std::printf("%.17g\n", (M * qdd + bias - tau).norm() / tau.norm());
    std::printf("%.17g\n", (M - M.transpose()).norm());
    std::printf("%.17g %.17g\n", jacobian(5, 0), jacobian(5, 1));
    return 0;
}
