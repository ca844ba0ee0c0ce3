#pragma once
#include <cstdio>
#define RCLCPP_ERROR(logger, ...) ((void)(logger), std::printf(__VA_ARGS__), std::printf("\n"))
