// The median pass over all states, for Pinocchio's loops by hand.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

constexpr int states = 65536, passes = 7;

template <class Call>
void report(const char *name, Call call) {
  std::vector<double> times;
  for (int pass = 0; pass < passes; ++pass) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < states; ++i) call(i);
    times.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(times.begin(), times.end());
  std::printf("Pinocchio  %-28s %8.1f ns\n", name, times[passes / 2] / states);
}
