// Runs the core's kernels without Python and prints the bytes of what they give, so that builds for
// unlike processors can be compared. All inputs are made of whole numbers here.
#include <bit>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "attitude/tilt.hpp"
#include "attitude/vqf.hpp"
#include "common/decompositions.hpp"
#include "common/elementary.hpp"
#include "navigation/leg.hpp"
#include "navigation/update.hpp"
#include "rate/filter.hpp"

namespace {

using namespace gyrofree;

// Uniform in [-1, 1) with 31 bits, by a linear congruential generator.
class Numbers {
 public:
  double next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(static_cast<std::int64_t>(state_ >> 33) - (1LL << 30)) / (1LL << 30);
  }
  template <typename M>
  M filled(M m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) m(i) = next();
    return m;
  }

 private:
  std::uint64_t state_ = 1;
};

void print(const char* name, double value) {
  std::printf("%s %016llx\n", name, static_cast<unsigned long long>(std::bit_cast<std::uint64_t>(value)));
}

template <typename M>
void print(const char* name, const Eigen::MatrixBase<M>& values) {
  for (Eigen::Index j = 0; j < values.cols(); ++j)
    for (Eigen::Index i = 0; i < values.rows(); ++i) print(name, values(i, j));
}

void print(const char* name, const Quaternion& q) { print(name, Vector<4>(q.w, q.x, q.y, q.z)); }

void run_elementary() {
  Numbers numbers;
  for (int i = 0; i < 2000; ++i) {
    const double u = numbers.next(), v = numbers.next(), angle = 1e5 * u * u * u;
    print("sin", elementary::sin(angle));
    print("cos", elementary::cos(angle));
    print("tan", elementary::tan(3.0 * u));
    print("atan2", elementary::atan2(u, v));
    print("asin", elementary::asin(u));
    print("acos", elementary::acos(u));
    print("exp", elementary::exp(700.0 * u));
    print("log", elementary::log(1e6 * v * v + 1e-9));
    print("pow", elementary::pow(1.5 + u, 8.0 * v));
  }
}

void run_matrices() {
  Numbers numbers;
  for (int i = 0; i < 20; ++i) {
    const auto A = numbers.filled(Matrix<12>()), B = numbers.filled(Matrix<12>());
    Matrix<12> C = product_transposed(A, A);
    C.diagonal().array() += 0.125;
    const Cholesky<Matrix<12>> factor(C);
    print("product", product(A, B));
    print("cholesky", factor.L);
    print("solved", factor.solved(B));
    print("eigen", SymmetricEigen<Matrix<12>>(C).values);
    print("singular", SingularValues(A).sigma);
  }
}

// Twelve axes, each of which reads one number of y = [omega', products, p].
rate::Sensor twelve_axes() {
  rate::Sensor s;
  s.n = rate::MEASURED;
  s.m = rate::PRODUCTS;
  s.plain = true;
  s.W.setZero();
  s.W.leftCols<rate::MEASURED>().setIdentity();
  s.M.setIdentity();
  s.SQ_alpha.setZero();
  s.SQ_force.setZero();
  s.R_alpha = Matrix3::Identity() * 0.25;
  s.R_p = Matrix3::Identity() * 0.0009765625;
  s.R_c = Matrix<rate::PRODUCTS>::Identity() * 0.25;
  s.known = Matrix<rate::PRODUCTS>::Identity() * 4.0;
  s.drift.setIdentity();
  s.Q.setZero();
  s.theta_b.setZero();
  s.used.setOnes();
  s.basis.setIdentity();
  s.spread.setConstant(0.25);
  return s;
}

rate::Tuning tuning(rate::Method method) {
  rate::Tuning t;
  t.method = static_cast<int>(method);
  t.scale = 1e-6;
  t.drift = 1e-8;
  t.centre = 1e-4;
  t.pivot_drift = 1e-8;
  t.still_rate = 1e-6;
  t.first_still_rate = 1e-6;
  t.products_gate = 1e4;
  t.force_gate = 1e4;
  t.unseen_alpha = 100.0;
  t.bias = 1e-2;
  t.tilt = 1e-2;
  t.gravity = 1e-6;
  t.pivot = 1e-2;
  return t;
}

// A standstill, then a turn about a tilted axis that gathers pace, with noise (E-30 to E-39, E-44).
void run_rate(const char* name, rate::Method method) {
  const rate::Sensor s = twelve_axes();
  const rate::Tuning t = tuning(method);
  Numbers numbers;
  rate::Filter f;
  rate::Said said;
  rate::Measurement rest = rate::Measurement::Zero();
  rest.segment<3>(rate::FORCE_M).z() = -rate::GRAVITY;
  f.x.segment<3>(rate::LIFT) = rest.segment<3>(rate::FORCE_M);
  f.P.diagonal().setConstant(1e-2);
  const Vector3 alpha(0.125, -0.25, 2.0);
  for (int k = 0; k < 300; ++k) {
    const bool turning = k >= 100;
    const double seconds = turning ? (k - 99) / 128.0 : 0.0;
    rate::Measurement y = rest + 0.03125 * numbers.filled(rate::Measurement());
    if (turning) {
      y.segment<3>(rate::ALPHA_M) += alpha;
      y.segment<rate::PRODUCTS>(rate::PRODUCTS_M) += rate::squares(seconds * alpha);
    }
    rate::step(f, s, t, y, {1.0 / 128.0, turning, false, k % 50 == 0 ? 0.5 : 0.0, nullptr}, said);
    print(name, f.x);
    print(name, said.nis);
  }
  print(name, f.P);
  print(name, f.q_nb);
}

void run_tilt() {
  Numbers numbers;
  attitude::PublishedTilt published;
  attitude::VectorTilt vector;
  published.period = vector.period = 0.01;
  published.w_gyro = vector.w_gyro = 10.0;
  attitude::Vqf vqf(0.01);
  for (int k = 0; k < 1000; ++k) {
    const Vector3 f_b = Vector3(0.5, -1.0, -9.75) + 0.5 * numbers.filled(Vector3());
    const Vector3 omega_b = 0.25 * numbers.filled(Vector3());
    print("published", published.step(f_b, omega_b));
    print("vector", vector.step(f_b, omega_b));
    print("vqf", vqf.step(f_b, omega_b));
  }
}

std::vector<navigation::Sample> drive(int samples) {
  Numbers numbers;
  std::vector<navigation::Sample> out(static_cast<std::size_t>(samples));
  for (int k = 0; k < samples; ++k) {
    auto& sample = out[static_cast<std::size_t>(k)];
    sample.t = (k + 1) / 128.0;
    sample.f_b = Vector3(0.5, 0.25, -9.8125) + 0.125 * numbers.filled(Vector3());
    sample.omega_b = Vector3(0.0, 0.0, 0.0625) + 0.0078125 * numbers.filled(Vector3());
  }
  return out;
}

// Twelve seconds of samples with a fix every second (E-105 to E-114).
void run_navigation() {
  navigation::Model model;
  model.density.setConstant(1e-4);
  navigation::Leg leg;
  leg.x.latitude = 0.875;
  leg.x.longitude = 0.125;
  leg.x.height = 128.0;
  const auto samples = drive(12 * 128);
  std::size_t k = 0;
  for (int second = 1; second <= 12; ++second) {
    k = navigation::run_leg(leg, model, samples, k, samples.size(), second, navigation::FOREVER);
    navigation::close(leg, model);
    leg.P = navigation::predicted(leg.P, leg.Phi, leg.Q);
    navigation::Fix fix;
    fix.t = second;
    fix.latitude = 0.875 + second * 0x1p-24;
    fix.longitude = 0.125;
    fix.height = 128.0;
    fix.has_v = true;
    const Vector3 rate_b = samples[k - 1].omega_b;
    const auto z = navigation::chosen(navigation::compared(leg, model, rate_b, Vector3::Zero(), fix), fix);
    const auto innovation = navigation::innovate(leg.P, z);
    const auto white = navigation::whiten(innovation.S, z.y);
    navigation::correct(leg, model, navigation::absorb(leg.P, innovation, white));
    print("nis", white.nis);
    print("place", Vector3(leg.x.latitude, leg.x.longitude, leg.x.height));
    print("velocity", leg.x.v_n);
    print("attitude", leg.x.C_nb);
    print("covariance", leg.P);
  }
}

}  // namespace

int main() {
  run_elementary();
  run_matrices();
  run_rate("ekf", rate::Method::EKF);
  run_rate("ukf", rate::Method::UKF);
  run_tilt();
  run_navigation();
}
