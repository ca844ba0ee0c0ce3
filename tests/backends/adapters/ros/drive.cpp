/* Runs a controller on numbers from standard input: gains, a state, and for computed torque a reference. */
#include <cstdlib>
#include <iostream>
#include <new>

#include "arm_plugin.cpp"

static long allocations = 0;

void *operator new(std::size_t size)
{
    allocations++;
    return std::malloc(size ? size : 1);
}

void operator delete(void *place) noexcept { std::free(place); }
void operator delete(void *place, std::size_t) noexcept { std::free(place); }

using namespace arm_controllers;

static std::vector<double> row()
{
    std::vector<double> values(dof);
    for (double &value : values) {
        std::string word;
        std::cin >> word;
        value = std::strtod(word.c_str(), nullptr);
    }
    return values;
}

template <class Kind> static int run(const std::vector<double> &gravity)
{
    Kind controller;
    controller_interface::ControllerInterface &own = controller;
    own.on_init();
    own.get_node()->parameters["stiffness"] = row();
    own.get_node()->parameters["damping"] = row();
    if (!gravity.empty()) {
        own.get_node()->parameters["gravity"] = gravity;
    }
    const std::vector<double> q = row(), qd = row();
    for (const std::string &name : own.state_interface_configuration().names) {
        own.state_interfaces_.insert(own.state_interfaces_.begin(), {name, 0.0}); /* in another order */
    }
    for (std::size_t k = 0; k < 2 * dof; k++) {
        own.state_interfaces_[2 * dof - 1 - k].value = k < dof ? q[k] : qd[k - dof];
    }
    for (const std::string &name : own.command_interface_configuration().names) {
        own.command_interfaces_.push_back({name, 0.0});
    }
    if (own.on_configure({}) != CallbackReturn::SUCCESS || own.on_activate({}) != CallbackReturn::SUCCESS) {
        return 1;
    }
    if (own.get_node()->callback) {
        auto point = std::make_shared<Point>();
        own.get_node()->callback(point); /* empty: left out */
        point->positions = row(), point->velocities = row(), point->accelerations = row();
        own.get_node()->callback(point);
    }
    const long before = allocations;
    for (int k = 0; k < 1000; k++) {
        if (own.update({}, {}) != return_type::OK) {
            return 2;
        }
    }
    std::cout << allocations - before << std::endl;
    for (const auto &command : own.command_interfaces_) {
        std::printf("%s %.17g\n", command.name.c_str(), command.value);
    }
    own.state_interfaces_[0].value = std::nan("");
    if (own.update({}, {}) != return_type::ERROR) {
        return 3;
    }
    own.on_deactivate({});
    return own.command_interfaces_[1].value == 0.0 ? 0 : 4;
}

int main(int count, char **words)
{
    std::vector<double> gravity;
    for (int k = 2; k < count; k++) {
        gravity.push_back(std::strtod(words[k], nullptr));
    }
    return words[1][0] == 'g' ? run<GravityCompensation>(gravity) : run<ComputedTorque>(gravity);
}
