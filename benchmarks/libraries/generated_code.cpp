// Writes C code of a quantity of a robot, by Pinocchio on CppADCodeGen's scalars: MODEL QUANTITY FILE.
// Called by benchmarks/generated_code.py.
#define BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS
#define BOOST_MPL_LIMIT_LIST_SIZE 30
#define BOOST_FUSION_INVOKE_MAX_ARITY 10
#include <pinocchio/codegen/cppadcg.hpp>

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

#include <fstream>
#include <string>
#include <vector>

using Base = CppAD::cg::CG<double>;
using Scalar = CppAD::AD<Base>;
using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;

// Results of one sample: whole matrices row by row, symmetric ones as their upper triangles.
struct Results {
  std::vector<Scalar> entries;

  void add(const Matrix& M, bool symmetric) {
    for (int i = 0; i < M.rows(); ++i)
      for (int j = symmetric ? i : 0; j < M.cols(); ++j) entries.push_back(M(i, j));
  }
};

int main(int, char** arguments) {
  const std::string quantity = arguments[2];
  pinocchio::Model numbers;
  pinocchio::serialization::loadFromText(numbers, arguments[1]);
  const auto model = numbers.cast<Scalar>();
  pinocchio::DataTpl<Scalar> data(model);
  const int nq = model.nq, nv = model.nv;
  const Eigen::VectorXd neutral = pinocchio::neutral(numbers);

  Vector x(nq + 2 * nv);
  for (int k = 0; k < x.size(); ++k) x[k] = Scalar(Base(k < nq ? neutral[k] : 0.1));
  CppAD::Independent(x);
  const Vector q = x.head(nq), v = x.segment(nq, nv), last = x.tail(nv);
  Results results;
  Matrix by_q = Matrix::Zero(nv, nv), by_v = Matrix::Zero(nv, nv), by_last = Matrix::Zero(nv, nv);
  if (quantity == "inverse_dynamics") {
    results.add(pinocchio::rnea(model, data, q, v, last), false);
  } else if (quantity == "forward_dynamics") {
    results.add(pinocchio::aba(model, data, q, v, last, pinocchio::Convention::LOCAL), false);
  } else if (quantity == "mass_matrix") {
    pinocchio::crba(model, data, q, pinocchio::Convention::LOCAL);
    results.add(data.M, true);
  } else {
    if (quantity == "inverse_dynamics_derivatives")
      pinocchio::computeRNEADerivatives(model, data, q, v, last, by_q, by_v, by_last);
    else if (quantity == "forward_dynamics_derivatives")
      pinocchio::computeABADerivatives(model, data, q, v, last, by_q, by_v, by_last);
    else
      return 1;
    results.add(by_q, false);
    results.add(by_v, false);
    results.add(by_last, true);
  }
  const Vector y = Eigen::Map<Vector>(results.entries.data(), results.entries.size());
  CppAD::ADFun<Base> function;
  function.Dependent(x, y);
  function.optimize();

  CppAD::cg::CodeHandler<double> handler;
  CppAD::vector<Base> inputs(static_cast<size_t>(x.size()));
  handler.makeVariables(inputs);
  CppAD::vector<Base> outputs = function.Forward(0, inputs);
  CppAD::cg::LanguageC<double> language("double");
  CppAD::cg::LangCDefaultVariableNameGenerator<double> names;
  std::ostringstream code;
  handler.generateCode(code, language, outputs, names);

  std::ofstream file(arguments[3]);
  file << "#include <math.h>\nstatic void one(const double *x, double *y) {\ndouble v["
       << handler.getTemporaryVariableCount() + 1 << "];\n" << code.str() << "}\n"
       << "void all(long n, const double *x, double *y) {\nfor (long k = 0; k < n; ++k) one(x + k * "
       << x.size() << ", y + k * " << y.size() << ");\n}\n";
}
