// Writes C code of a quantity of a robot, by Pinocchio on CppADCodeGen's scalars: MODEL QUANTITY FILE.
// Called by benchmarks/generated_code.py.
#define BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS
#define BOOST_MPL_LIMIT_LIST_SIZE 30
#define BOOST_FUSION_INVOKE_MAX_ARITY 10
#include <pinocchio/codegen/cppadcg.hpp>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

#include <fstream>
#include <string>

using Base = CppAD::cg::CG<double>;
using Scalar = CppAD::AD<Base>;
using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

int main(int, char** arguments) {
  const std::string quantity = arguments[2];
  pinocchio::Model numbers;
  pinocchio::serialization::loadFromText(numbers, arguments[1]);
  const auto model = numbers.cast<Scalar>();
  pinocchio::DataTpl<Scalar> data(model);
  const int nq = model.nq, nv = model.nv;
  const Eigen::VectorXd neutral = pinocchio::neutral(numbers);

  Vector x(nq + 2 * nv), y;
  for (int k = 0; k < x.size(); ++k) x[k] = Scalar(Base(k < nq ? neutral[k] : 0.1));
  CppAD::Independent(x);
  const Vector q = x.head(nq), v = x.segment(nq, nv), last = x.tail(nv);
  if (quantity == "inverse_dynamics") {
    y = pinocchio::rnea(model, data, q, v, last);
  } else {
    pinocchio::crba(model, data, q, pinocchio::Convention::LOCAL);
    y.resize(nv * (nv + 1) / 2);
    int entry = 0;
    for (int i = 0; i < nv; ++i)
      for (int j = i; j < nv; ++j) y[entry++] = data.M(i, j);
  }
  CppAD::ADFun<Base> function;
  function.Dependent(x, y);
  function.optimize();

  CppAD::cg::CodeHandler<double> handler;
  CppAD::vector<Base> inputs(static_cast<size_t>(x.size()));
  handler.makeVariables(inputs);
  CppAD::vector<Base> results = function.Forward(0, inputs);
  CppAD::cg::LanguageC<double> language("double");
  CppAD::cg::LangCDefaultVariableNameGenerator<double> names;
  std::ostringstream code;
  handler.generateCode(code, language, results, names);

  std::ofstream file(arguments[3]);
  file << "#include <math.h>\nstatic void one(const double *x, double *y) {\ndouble v["
       << handler.getTemporaryVariableCount() + 1 << "];\n" << code.str() << "}\n"
       << "void all(long n, const double *x, double *y) {\nfor (long k = 0; k < n; ++k) one(x + k * "
       << x.size() << ", y + k * " << y.size() << ");\n}\n";
}
