// Alignment for Python.
#include "common/python.hpp"
#include "navigation/alignment.hpp"

#include <stdexcept>

namespace gyrofree {
namespace {

using namespace navigation;

Vector3 vector(const VectorIn& v, const char* name) {
  if (v.shape(0) != 3) throw std::invalid_argument(std::string(name) + ": want 3 numbers");
  return map(v);
}

nb::tuple carried_of(const VectorIn& t, const MatrixIn& f_b, const MatrixIn& omega_b, const VectorIn& times,
                     const VectorIn& bias_accel, const VectorIn& bias_gyro) {
  if (f_b.shape(1) != 3 || omega_b.shape(1) != 3 || f_b.shape(0) != t.shape(0) || omega_b.shape(0) != t.shape(0))
    throw std::invalid_argument("samples: want t (n,), f_b (n, 3), omega_b (n, 3)");
  if (times.shape(0) == 0) throw std::invalid_argument("times: want one at least");
  const auto n = static_cast<Eigen::Index>(t.shape(0));
  const WindowSamples samples{map(t), {f_b.data(), n, 3}, {omega_b.data(), n, 3}};
  const auto rows = carried(samples, map(times), {vector(bias_accel, "bias_accel"), vector(bias_gyro, "bias_gyro")});
  auto C = new_array<nb::ndarray<nb::numpy, double, nb::ndim<3>>>({rows.size(), 3, 3});
  auto u = new_array<MatrixOut>({rows.size(), 3});
  for (std::size_t k = 0; k < rows.size(); ++k) {
    Eigen::Map<RowMajor>(C.data() + 9 * k, 3, 3) = rows[k].C_0k;
    Eigen::Map<Vector3>(u.data() + 3 * k) = rows[k].u_0;
  }
  return nb::make_tuple(C, u);
}

}  // namespace

void bind_alignment(nb::module_& m) {
  nb::module_ a = m.def_submodule("alignment", "Alignment under way (inertial/navigation/alignment_motion).");
  a.def("carried", &carried_of, nb::arg("t"), nb::arg("f_b"), nb::arg("omega_b"), nb::arg("times"),
        nb::arg("bias_accel"), nb::arg("bias_gyro"),
        "C_0k (m, 3, 3) and u (m, 3) in the body at times[0], at each of times[1:] (E-80)");
}

}  // namespace gyrofree
