// elementary.* and small linear algebra for Python: arrays in, arrays out, the same bits everywhere.
#include <stdexcept>

#include "common/elementary.hpp"
#include "common/python.hpp"

namespace gyrofree {
namespace {

using AnyIn = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using AnyOut = nb::ndarray<nb::numpy, double>;

// A new array of x's shape.
AnyOut like(const AnyIn& x) {
  auto* numbers = new double[x.size() == 0 ? 1 : x.size()];
  nb::capsule owner(numbers, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  std::vector<std::size_t> shape(x.ndim());
  for (std::size_t d = 0; d < x.ndim(); ++d) shape[d] = x.shape(d);
  return AnyOut(numbers, shape.size(), shape.data(), owner);
}

template <double (*Function)(double)>
AnyOut each(const AnyIn& x) {
  AnyOut out = like(x);
  for (std::size_t i = 0; i < x.size(); ++i) out.data()[i] = Function(x.data()[i]);
  return out;
}

AnyOut each_atan2(const AnyIn& y, const AnyIn& x) {
  if (y.size() != x.size()) throw std::invalid_argument("y and x want one shape");
  AnyOut out = like(y);
  for (std::size_t i = 0; i < x.size(); ++i) out.data()[i] = elementary::atan2(y.data()[i], x.data()[i]);
  return out;
}

template <double (*Function)(double)>
void define(nb::module_& m, const char* name, const char* what) {
  m.def(name, Function, nb::arg("x"), what);
  m.def(name, &each<Function>, nb::arg("x"));
}

using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

Cholesky<Square> factor_of(const MatrixIn& C) {
  if (C.shape(0) != C.shape(1)) throw std::invalid_argument("C is not square: want the shape (n, n)");
  return Cholesky<Square>(Square(map(C)));
}

MatrixOut product_of(const MatrixIn& a, const MatrixIn& b) {
  if (a.shape(1) != b.shape(0) || a.shape(1) == 0)
    throw std::invalid_argument("A (n, k) and B (k, m) do not fit: their inner sizes differ or are 0");
  return to_numpy(product(map(a), map(b)));
}

MatrixOut solve_positive(const MatrixIn& C, const MatrixIn& B) {
  if (C.shape(0) != B.shape(0)) throw std::invalid_argument("B wants as many rows as C");
  const auto factor = factor_of(C);
  if (!factor.positive) throw std::invalid_argument("C is not positive definite");
  return to_numpy(factor.solved(Square(map(B))));
}

MatrixOut lower_factor(const MatrixIn& C) {
  const auto factor = factor_of(C);
  if (!factor.positive) throw std::invalid_argument("C is not positive definite");
  return to_numpy(factor.L);
}

}  // namespace

void bind_elementary(nb::module_& m) {
  define<elementary::sin>(m, "sin", "sine of x, rad; a number or an array");
  define<elementary::cos>(m, "cos", "cosine of x, rad");
  define<elementary::tan>(m, "tan", "tangent of x, rad");
  define<elementary::atan>(m, "atan", "inverse tangent, rad");
  define<elementary::asin>(m, "asin", "inverse sine, rad; x beyond +-1 counts as +-1");
  define<elementary::acos>(m, "acos", "inverse cosine, rad; x beyond +-1 counts as +-1");
  define<elementary::exp>(m, "exp", "e to the x");
  define<elementary::log>(m, "log", "natural logarithm");
  m.def("atan2", &elementary::atan2, nb::arg("y"), nb::arg("x"), "angle of the point (x, y), rad");
  m.def("atan2", &each_atan2, nb::arg("y"), nb::arg("x"), "the same of two arrays of one shape");
  m.def("pow", &elementary::pow, nb::arg("base"), nb::arg("exponent"), "base > 0 to the exponent");
  m.def("product", &product_of, nb::arg("A"), nb::arg("B"), "A B of (n, k) and (k, m)");
  m.def("cholesky", &lower_factor, nb::arg("C"), "lower L with L L^T = C; raises ValueError without one");
  m.def("solve_positive", &solve_positive, nb::arg("C"), nb::arg("B"),
        "X with C X = B for a positive definite C (n, n), B (n, m); raises ValueError otherwise");
}

}  // namespace gyrofree
