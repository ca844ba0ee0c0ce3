// Writes C for one robot: Pinocchio's algorithms recorded by CppAD, differentiated and printed by CppADCodeGen.
//
// usage: cppadcg_writer ROBOT.txt OUTPUT.c FUNCTION...
#include <pinocchio/codegen/cppadcg.hpp>

#include <fstream>
#include <functional>
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio_model.hpp"
#include "serial_joints.hpp"

namespace {

using Coded = CppAD::cg::CG<double>;
using Recorded = CppAD::AD<Coded>;
using Model = pinocchio::ModelTpl<Recorded, 0, SerialJoints>;
using Data = pinocchio::DataTpl<Recorded, 0, SerialJoints>;
using Vector = Eigen::Matrix<Recorded, Eigen::Dynamic, 1>;
using Matrix = Eigen::Matrix<Recorded, Eigen::Dynamic, Eigen::Dynamic>;
using Algorithm = std::function<void(Data &, const Vector &, const Vector &, const Vector &, std::vector<Recorded> &)>;

/// The matrix whose upper triangle is given.
Matrix symmetric(Matrix M) {
  M.triangularView<Eigen::StrictlyLower>() = M.transpose();
  return M;
}

/// Entries behind what is there already, row by row.
void give(const Matrix &matrix, std::vector<Recorded> &to) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) to.push_back(matrix(i, j));
}

struct Writer {
  Model model;
  std::ofstream out;

  /// What an algorithm puts out, as a function of q, qd and x behind each other.
  CppAD::ADFun<Coded> recorded(const Algorithm &algorithm) const {
    const auto nq = model.nq, n = model.nv;
    Vector inputs = Vector::Zero(nq + 2 * n);
    inputs.head(nq) = pinocchio::neutral(model);
    CppAD::Independent(inputs);
    Data data(model);
    std::vector<Recorded> outputs;
    algorithm(data, inputs.head(nq), inputs.segment(nq, n), inputs.tail(n), outputs);
    Vector all = Eigen::Map<Vector>(outputs.data(), Eigen::Index(outputs.size()));
    CppAD::ADFun<Coded> found(inputs, all);
    found.optimize();
    return found;
  }

  /// A C function of the algorithm's outputs.
  void value(const std::string &name, const Algorithm &algorithm) {
    auto function = recorded(algorithm);
    print(name, [&](const std::vector<Coded> &x) { return function.Forward(0, x); });
  }

  /// A C function of its derivatives by q, qd and x of joints with a coordinate each, behind its n outputs where they are wanted too.
  void jacobian(const std::string &name, const Algorithm &algorithm, bool with_outputs) {
    auto function = recorded(algorithm);
    print(name, [&](const std::vector<Coded> &x) {
      const std::vector<Coded> values = function.Forward(0, x), rows = function.Jacobian(x);
      std::vector<Coded> all;
      if (with_outputs) all = values;
      const std::size_t n = values.size();
      for (std::size_t block = 0; block < 3; ++block)
        for (std::size_t i = 0; i < n; ++i)
          for (std::size_t j = 0; j < n; ++j) all.push_back(rows[i * 3 * n + block * n + j]);
      return all;
    });
  }

  template <class Outputs>
  void print(const std::string &name, Outputs outputs) {
    const auto nq = std::size_t(model.nq), n = std::size_t(model.nv);
    CppAD::cg::CodeHandler<double> handler;
    std::vector<Coded> x(nq + 2 * n);
    handler.makeVariables(x);
    std::vector<Coded> y = outputs(x);
    std::vector<std::string> given, found;
    const auto name_inputs = [&](const std::string &input, std::size_t size) {
      for (std::size_t j = 0; j < size; ++j) given.push_back(input + "[" + std::to_string(j) + "]");
    };
    name_inputs("q", nq), name_inputs("qd", n), name_inputs("x", n);
    for (std::size_t j = 0; j < y.size(); ++j) found.push_back("out[" + std::to_string(j) + "]");
    CppAD::cg::LangCCustomVariableNameGenerator<double> names(found, given, "v", "w");
    CppAD::cg::LanguageC<double> language("double");
    std::ostringstream body;
    handler.generateCode(body, language, y, names);
    out << "void " << name << "(const double *q, const double *qd, const double *x, double *out)\n{\n"
        << "double v[" << handler.getTemporaryVariableCount() + 1 << "];\n(void)qd; (void)x;\n"
        << body.str() << "}\n";
  }

  /// The C function of that name.
  void write(const std::string &name) {
    using pinocchio::Convention;
    const Algorithm rnea = [this](Data &d, const Vector &q, const Vector &qd, const Vector &x, auto &to) {
      give(pinocchio::rnea(model, d, q, qd, x), to);
    };
    const Algorithm aba = [this](Data &d, const Vector &q, const Vector &qd, const Vector &x, auto &to) {
      give(pinocchio::aba(model, d, q, qd, x, Convention::LOCAL), to);
    };
    if (name == "inverse_dynamics") value(name, rnea);
    if (name == "forward_dynamics") value(name, aba);
    if (name == "mass_matrix") value(name, [this](Data &d, const Vector &q, const Vector &, const Vector &, auto &to) {
      pinocchio::crba(model, d, q, Convention::LOCAL);
      give(symmetric(d.M), to);
    });
    if (name == "inverse_dynamics_derivatives_jacobian") jacobian(name, rnea, false);
    if (name == "forward_dynamics_derivatives_jacobian") jacobian(name, aba, true);
    if (name == "inverse_dynamics_derivatives_recursion") value(name, [this](Data &d, const Vector &q, const Vector &qd, const Vector &x, auto &to) {
      pinocchio::computeRNEADerivatives(model, d, q, qd, x);
      for (const Matrix &matrix : {Matrix(d.dtau_dq), Matrix(d.dtau_dv), symmetric(d.M)}) give(matrix, to);
    });
    if (name == "forward_dynamics_derivatives_recursion") value(name, [this](Data &d, const Vector &q, const Vector &qd, const Vector &x, auto &to) {
      pinocchio::computeABADerivatives(model, d, q, qd, x);
      give(d.ddq, to);
      for (const Matrix &matrix : {Matrix(d.ddq_dq), Matrix(d.ddq_dv), symmetric(d.Minv)}) give(matrix, to);
    });
  }
};

}  // namespace

int main(int count, char **arguments) {
  if (count < 3) return 2;
  Writer writer{{}, std::ofstream(arguments[2])};
  std::ifstream robot(arguments[1]);
  read_model(robot, writer.model);
  writer.out << "#include <math.h>\n";
  for (int k = 3; k < count; ++k) writer.write(arguments[k]);
  return 0;
}
