// Single equations of the rate estimators: tests compare them with their numpy twins.
#include <stdexcept>

#include "common/decompositions.hpp"
#include "rate/bind_rate.hpp"
#include "rate/least_squares.hpp"
#include "rate/row.hpp"

namespace gyrofree::rate {
namespace {

Filter filter_of(const VectorIn& x, const MatrixIn& P) {
  Filter f;
  f.x = map(x);
  f.P = map(P);
  return f;
}

nb::tuple told(const Filter& f, const Likelihood& likelihood) {
  return nb::make_tuple(to_numpy_vector(f.x), to_numpy(f.P), likelihood.nis, likelihood.density);
}

Vector3 three(const VectorIn& v) { return map(v); }

nb::tuple predicted(const VectorIn& x, const MatrixIn& P, const VectorIn& alpha_m, double dt, bool turning,
                    bool fixed, bool unscented, const Sensor& s) {
  Filter f = filter_of(x, P);
  const Drive drive{three(alpha_m), along_axis(f.omega(), fixed, turning), dt, turning, Vector3::Zero()};
  unscented ? predict_unscented(f.x, f.P, drive, s) : predict(f.x, f.P, drive, s);
  return told(f, {});
}

nb::tuple corrected_by_products(const VectorIn& x, const MatrixIn& P, const VectorIn& c_m, bool unscented,
                                const Sensor& s, const Tuning& t) {
  Filter f = filter_of(x, P);
  Said said;
  const Products c = map(c_m);
  const Likelihood likelihood =
      unscented ? by_products_unscented(f, c, s, t, said) : by_products(f, c, f.omega(), s, t, said);
  return told(f, likelihood);
}

nb::tuple corrected_by_force(const VectorIn& x, const MatrixIn& P, const VectorIn& p, const VectorIn& alpha,
                             const VectorIn& late, bool turning, const Sensor& s, const Tuning& t) {
  Filter f = filter_of(x, P);
  return told(f, by_force(f, three(p), three(alpha), three(late), turning, s, t));
}

nb::tuple corrected_by_standstill(const VectorIn& x, const MatrixIn& P, const VectorIn& alpha_m, const Sensor& s,
                                  const Tuning& t) {
  Filter f = filter_of(x, P);
  by_standstill(f, three(alpha_m), Vector3::Zero(), s, t);
  return told(f, {});
}

VectorOut derivative_of(const VectorIn& y, const VectorIn& u, const Sensor& s) {
  return to_numpy_vector(derivative(map(y), map(u), s));
}

VectorOut integrated(const VectorIn& y, const VectorIn& before, const VectorIn& after, const Sensor& s, double dt) {
  return to_numpy_vector(runge_kutta(map(y), map(before), map(after), s, dt));
}

VectorOut level_of(const VectorIn& up_b) {
  auto out = new_array<VectorOut>({4});
  put(out.data(), level(three(up_b)));
  return out;
}

// The zero-velocity detector alone.
class Detector {
 public:
  void take(const Sensor& s, const VectorIn& a, double dt) {
    if (a.shape(0) != static_cast<std::size_t>(s.n)) throw std::invalid_argument("want a reading of every axis");
    watch_.take(s, a.data(), dt);
  }
  nb::tuple detect(const Sensor& s, const StillLimits& c, const VectorIn& omega_b, const MatrixIn& P, double dt) {
    const Verdict verdict = watch_.detect(s, c, three(omega_b), Matrix3(map(P)), dt);
    return nb::make_tuple(verdict.still, verdict.depth);
  }
  void forget() { watch_.forget(); }
  int learning() const { return watch_.learning_samples(); }
  VectorOut reference() const { return to_numpy_vector(watch_.learnt_mean()); }

 private:
  Watch watch_;
};

nb::tuple svd(const MatrixIn& A) {
  const SingularValues found(Eigen::MatrixXd(map(A)));
  return nb::make_tuple(to_numpy(found.U), to_numpy_vector(found.sigma), to_numpy(found.V));
}

nb::tuple eigh(const MatrixIn& A) {
  const SymmetricEigen<Eigen::MatrixXd> found{Eigen::MatrixXd(map(A))};
  return nb::make_tuple(to_numpy_vector(found.values), to_numpy(found.vectors));
}

}  // namespace

void bind_rate_kernels(nb::module_& m) {
  m.def("svd", &svd, nb::arg("A"), "U (m, n), sigma (n,) descending, V (n, n) with A = U diag(sigma) V^T (m, n).");
  m.def("eigh", &eigh, nb::arg("A"), "Eigenvalues (n,) ascending and vectors (n, n) of a symmetric matrix.");
  m.def("rate_predict", &predicted, "Prediction (E-31, E-32, E-44) without noise.");
  m.def("rate_by_products", &corrected_by_products, "Correction by the products (E-33, E-34, E-44).");
  m.def("rate_by_force", &corrected_by_force, "Correction by gravity and the pivot (E-35).");
  m.def("rate_by_standstill", &corrected_by_standstill, "Correction by standstill (E-38).");
  m.def("rate_derivative", &derivative_of, "dy/dt of the integrating estimator (E-6).");
  m.def("rate_runge_kutta", &integrated, "One step of it (E-6).");
  m.def("rate_level", &level_of, nb::arg("up_b"), "q_nb of a body at rest (E-11).");
  m.def(
      "rate_information", [](const VectorIn& omega, const Sensor& s) { return to_numpy_vector(information(three(omega), s)); },
      "Fisher information of one sample's products on omega (E-43).");
  nb::class_<Detector>(m, "RateDetector", "The zero-velocity detector (E-20 to E-25).")
      .def(nb::init<>())
      .def("take", &Detector::take)
      .def("detect", &Detector::detect)
      .def("forget", &Detector::forget)
      .def_prop_ro("learning", &Detector::learning)
      .def_prop_ro("reference", &Detector::reference, nb::rv_policy::automatic);
}

}  // namespace gyrofree::rate
