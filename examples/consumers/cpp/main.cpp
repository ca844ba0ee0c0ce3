// A C++17 program that uses two emitted packages at once: each robot runs in a thread of its own.
#include <cstdio>
#include <thread>
#include <type_traits>

#include <scara/scara.hpp>
#include <two_link/two_link.hpp>

// Sizes, names and limits are known to the compiler, and nothing throws.
static_assert(two_link::Robot::dof == 2 && scara::Robot::dof == 4);
static_assert(two_link::Robot::joint_names[0][0] == 's');
static_assert(two_link::Robot::speed_limit[1] > 0.0);
static_assert(noexcept(two_link::Robot::gravity(two_link::Robot::Vector{})));
static_assert(std::is_empty_v<two_link::Robot> && std::is_trivially_copyable_v<two_link::RobotWithParameters>);

// A control law takes any robot: its own parameters, or those given at run time.
template <class Dynamics>
typename Dynamics::Vector torque(const Dynamics &dynamics, std::size_t steps)
{
    typename Dynamics::Vector q{}, qd{}, qdd{}, tau{};
    for (std::size_t step = 0; step < steps; step++) {
        for (std::size_t joint = 0; joint < Dynamics::dof; joint++) {
            q[joint] = 1e-4 * static_cast<double>(step * (joint + 1));
            qd[joint] = 0.5 - q[joint];
            qdd[joint] = q[joint] - 0.2;
        }
        tau = dynamics.inverse_dynamics(q, qd, qdd);
    }
    return tau;
}

template <class Vector>
void print(const char *name, const Vector &vector)
{
    std::printf("%s", name);
    for (const auto value : vector) {
        std::printf(" %.17g", value);
    }
    std::printf("\n");
}

int main()
{
    constexpr std::size_t steps = 20000;
    const two_link::Robot arm;
    const scara::RobotWithParameters loaded(scara::Robot::theta_b);

    two_link::Robot::Vector first{};
    scara::Robot::Vector second{};
    std::thread one([&] { first = torque(arm, steps); });
    std::thread two([&] { second = torque(loaded, steps); });
    one.join();
    two.join();
    print("two_link", first);
    print("scara", second);

    two_link::Robot::Vector qdd{};
    if (const int failed = arm.forward_dynamics(first, first, first, qdd)) {
        std::fprintf(stderr, "the mass matrix is singular at %s\n", two_link::Robot::joint_names[failed - 1]);
        return 1;
    }
    return !(first == torque(arm, steps) && second == torque(loaded, steps));
}
