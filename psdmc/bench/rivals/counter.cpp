// Runs contestants' loops once each, under callgrind, which counts what happens inside them and nothing else.
//
// usage: counter LIBRARY ROBOT.txt JOBS.txt; a job is a line: symbol, nq, nv, length of a fourth input, outputs, states a call,
// states in all, file of q, qd, x and the fourth input as doubles.
#include <dlfcn.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "loops.hpp"

int main(int, char **arguments) {
  void *library = dlopen(arguments[1], RTLD_NOW);
  if (!library) return std::cerr << dlerror() << "\n", 1;
  std::ifstream robot(arguments[2]);
  const std::string text{std::istreambuf_iterator<char>(robot), {}};
  using Setup = int (*)(const char *);
  if (auto setup = reinterpret_cast<Setup>(dlsym(library, "setup"))) setup(text.c_str());

  std::ifstream jobs(arguments[3]);
  std::string symbol, states;
  std::size_t nq, nv, more, outputs, block, count;
  while (jobs >> symbol >> nq >> nv >> more >> outputs >> block >> count >> states) {
    std::vector<double> values((nq + 2 * nv + more) * count), output(outputs * count), seconds(count);
    std::ifstream(states, std::ios::binary).read(reinterpret_cast<char *>(values.data()), std::streamsize(values.size() * 8));
    const double *q = values.data();
    const double *qd = q + nq * count, *x = qd + nv * count;
    const bench::Work work{count, nq, nv, outputs, count, q, qd, x, output.data(), more, x + nv * count};
    using Loop = void (*)(const bench::Work *, std::size_t, double *);
    auto loop = reinterpret_cast<Loop>(dlsym(library, (symbol + "_throughput").c_str()));
    if (!loop) return std::cerr << dlerror() << "\n", 1;
    loop(&work, block, seconds.data());
  }
  return 0;
}
