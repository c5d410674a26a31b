// Attitude filters for Python: one sample at a time or many, with the same numbers.
#include "attitude/tilt.hpp"
#include "attitude/vqf.hpp"

#include <stdexcept>

#include "common/bind_fields.hpp"

namespace gyrofree {

using namespace attitude;

namespace {

constexpr Eigen::Index QUATERNION = 4;  // numbers in one

void want_samples(const MatrixIn& f_b, const MatrixIn& omega_b) {
  if (f_b.shape(1) != 3 || omega_b.shape(1) != 3 || f_b.shape(0) != omega_b.shape(0))
    throw std::invalid_argument("f_b and omega_b: want the same shape (n, 3)");
}

// q_nb (n, 4) after each of n samples.
template <typename Filter>
MatrixOut batch(Filter& filter, const MatrixIn& f_b, const MatrixIn& omega_b) {
  want_samples(f_b, omega_b);
  auto out = new_array<MatrixOut>({f_b.shape(0), QUATERNION});
  Eigen::Map<RowMajor> rows(out.data(), static_cast<Eigen::Index>(f_b.shape(0)), QUATERNION);
  for (Eigen::Index k = 0; k < rows.rows(); ++k) {
    const Quaternion q = filter.step(map(f_b).row(k), map(omega_b).row(k));
    rows.row(k) << q.w, q.x, q.y, q.z;
  }
  return out;
}

template <typename Filter>
nb::class_<Filter> bind_filter(nb::module_& m, const char* name, const char* what) {
  return bind_fields<Filter>(m, name, what)
      .def("batch", &batch<Filter>, nb::arg("f_b"), nb::arg("omega_b"),
           "q_nb (n, 4) after each of n samples, f_b (n, 3) in m/s^2, omega_b (n, 3) in rad/s");
}

}  // namespace

void bind_attitude(nb::module_& m) {
  nb::module_ a = m.def_submodule("attitude", "Tilt filters of six-axis boards.");
  a.attr("__name__") = "attitude";  // pickle finds its classes there, whichever build is loaded
  bind_fields<Quaternion>(a, "Quaternion", "w x y z, unit length");
  bind_fields<Butterworth>(a, "Butterworth", "low-pass of second order");
  bind_fields<LowPass<2>>(a, "LowPass2", "memory of a low-pass of two signals");
  bind_fields<LowPass<3>>(a, "LowPass3", "memory of a low-pass of three signals");
  bind_fields<LowPass<9>>(a, "LowPass9", "memory of a low-pass of nine signals");
  bind_filter<PublishedTilt>(a, "PublishedTilt", "the published tilt filter (E-72 to E-75)");
  bind_filter<VectorTilt>(a, "VectorTilt", "its weighting on whole rotations (E-76)");
  bind_filter<Vqf>(a, "Vqf", "VQF without magnetometer (E-79c to E-79i)");
  a.def("vqf", [](double period) { return Vqf(period); }, nb::arg("period"), "A Vqf for samples of a period, s.");
  a.def("from_projection_angles",
        [](double xz, double yz, double sign_z) { return to_numpy_vector(from_projection_angles(xz, yz, sign_z)); },
        nb::arg("xz"), nb::arg("yz"), nb::arg("sign_z"), "R (3,) of two projection angles, rad (E-73)");
}

}  // namespace gyrofree
