/* The part of ros2_control and rclcpp that psdmc's controllers call, written from its documentation for tests. */
#pragma once

#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace rclcpp {
struct Time {};
struct Duration {};

struct Parameter {
    std::vector<double> value;
    std::vector<double> as_double_array() const { return value; }
};

template <class Message> struct Subscription {
    using SharedPtr = std::shared_ptr<Subscription>;
};
} // namespace rclcpp

namespace rclcpp_lifecycle {
struct State {};

struct Node {
    std::map<std::string, std::vector<double>> parameters;
    std::function<void(std::shared_ptr<void>)> callback;

    int get_logger() const { return 0; }
    rclcpp::Parameter get_parameter(const std::string &name) const { return {parameters.at(name)}; }

    template <class Message, class Callback>
    std::shared_ptr<rclcpp::Subscription<Message>> create_subscription(const std::string &, int, Callback call)
    {
        callback = [call](std::shared_ptr<void> message) { call(std::static_pointer_cast<Message>(message)); };
        return std::make_shared<rclcpp::Subscription<Message>>();
    }
};
} // namespace rclcpp_lifecycle

namespace controller_interface {
enum class CallbackReturn { SUCCESS, ERROR };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };

struct InterfaceConfiguration {
    interface_configuration_type type;
    std::vector<std::string> names;
};

struct Interface {
    std::string name;
    double value;
    const std::string get_name() const { return name; }
    double get_value() const { return value; }
    [[nodiscard]] bool set_value(double given) { return value = given, true; }
};

class ControllerInterface {
public:
    virtual ~ControllerInterface() = default;
    virtual CallbackReturn on_init() = 0;
    virtual InterfaceConfiguration command_interface_configuration() const = 0;
    virtual InterfaceConfiguration state_interface_configuration() const = 0;
    virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
    std::shared_ptr<rclcpp_lifecycle::Node> get_node() { return node_; }

    template <class Type> void auto_declare(const std::string &name, const Type &value) { node_->parameters.emplace(name, value); }

    std::vector<Interface> command_interfaces_, state_interfaces_;

private:
    std::shared_ptr<rclcpp_lifecycle::Node> node_ = std::make_shared<rclcpp_lifecycle::Node>();
};
} // namespace controller_interface
