// Forward dynamics of a robot with closed loops: psdmc's C and Pinocchio's C++, in one program. benchmarks/contacts.py
// writes the input and compiles this file with the package `robot`, whose loops are shared coordinates.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <vector>

#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/algorithm/contact-dynamics.hpp>
#include <pinocchio/algorithm/proximal.hpp>

#include "pinocchio_model.hpp"

extern "C" int robot_forward_dynamics(const double *q, const double *qd, const double *tau, double *qdd);

namespace pin = pinocchio;
using Clock = std::chrono::steady_clock;
using Loops = std::vector<pin::RigidConstraintModel, Eigen::aligned_allocator<pin::RigidConstraintModel>>;
using Datas = std::vector<pin::RigidConstraintData, Eigen::aligned_allocator<pin::RigidConstraintData>>;
using Vectors = std::vector<Eigen::VectorXd>;

constexpr std::size_t BLOCK = 512;

/// Largest relative error of accelerations with which a setting of Pinocchio counts.
constexpr double SAME = 1e-9;

template <class Call> double per_call(const Vectors &states, std::size_t rounds, const Call &call) {
  std::vector<double> times;
  for (std::size_t round = 0; round < rounds; ++round)
    for (std::size_t first = 0; first + BLOCK <= states.size(); first += BLOCK) {
      const auto start = Clock::now();
      for (std::size_t k = first; k < first + BLOCK; ++k) call(k);
      times.push_back(std::chrono::duration<double, std::nano>(Clock::now() - start).count() / BLOCK);
    }
  std::nth_element(times.begin(), times.begin() + times.size() / 2, times.end());
  return times[times.size() / 2];
}

pin::SE3 read_placement(std::istream &text) {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  for (int i = 0; i < 9; ++i) text >> rotation(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) text >> translation(i);
  return pin::SE3(rotation, translation);
}

/// Prints psdmc's and Pinocchio's time in ns, Pinocchio's error, and its mu and number of steps.
int main(int, char **arguments) {
  std::ifstream text(arguments[1]);
  pin::Model model;
  read_model(text, model);
  std::size_t number, own, count, rounds;
  text >> number;
  Loops loops;
  Datas datas;
  for (std::size_t k = 0; k < number; ++k) {
    std::size_t first, second;
    text >> first >> second;
    const auto one = read_placement(text), other = read_placement(text);
    loops.emplace_back(pin::CONTACT_3D, model, first, one, second, other, pin::LOCAL);
    datas.emplace_back(loops.back());
  }
  text >> own >> count >> rounds;
  Vectors q, v, tau, tree_q, tree_v, tree_tau, tree_qdd;
  const auto read = [&text](Vectors &to, Eigen::Index size) {
    to.emplace_back(size);
    for (Eigen::Index i = 0; i < size; ++i) text >> to.back()[i];
  };
  Eigen::MatrixXd ratios(model.nv, own);
  for (Eigen::Index i = 0; i < ratios.size(); ++i) text >> ratios(i / ratios.cols(), i % ratios.cols());
  for (std::size_t k = 0; k < count; ++k) {
    read(q, own), read(v, own), read(tau, own);
    read(tree_q, model.nq), read(tree_v, model.nv), read(tree_tau, model.nv);
  }
  if (!text) return 1;

  Eigen::VectorXd qdd(own);
  const auto ours = [&](std::size_t k) { robot_forward_dynamics(q[k].data(), v[k].data(), tau[k].data(), qdd.data()); };
  const double time = per_call(q, rounds, ours);

  pin::Data data(model);
  pin::initConstraintDynamics(model, data, loops, datas);
  double best = 0.0, error = 0.0, mu = 0.0;
  int steps = 0;
  for (const double shift : {1e-4, 1e-6, 1e-8, 1e-10})
    for (int most = 1; most < 6; ++most) {
      pin::ProximalSettings settings(0.0, shift, most);
      const auto theirs = [&](std::size_t k) {
        pin::constraintDynamics(model, data, tree_q[k], tree_v[k], tree_tau[k], loops, datas, settings);
      };
      double worst = 0.0;
      for (std::size_t k = 0; k < count; k += 37) {
        ours(k), theirs(k);
        worst = std::max(worst, (ratios * qdd - data.ddq).cwiseAbs().maxCoeff() / data.ddq.cwiseAbs().maxCoeff());
      }
      if (!(worst < SAME)) continue;
      const double found = per_call(q, rounds, theirs);
      if (best == 0.0 || found < best) best = found, error = worst, mu = shift, steps = most;
    }
  std::printf("%.17g %.17g %.17g %.17g %d\n", time, best, error, mu, steps);
  return best == 0.0;
}
