#include "rate/inexact.hpp"

namespace gyrofree::rate {
namespace {

constexpr double ACROSS = 0.7;      // of an error along its axis: that of its direction
constexpr double MEMORY_S = 20.0;   // s of turning
constexpr double USUAL_SCALE = 5e-5;  // of 1, squared
constexpr double EXPECTED = 1.6;      // of the configured variance, before innovations tell
// Innovations see a few combinations of the errors, the rate follows others: a variance by three numbers
// is four times too small once in ten.
constexpr double FEW = 4.0;
constexpr double BIASES_SURE = 3.0;  // of their variance: what is beyond is no bias

// d y / d errors: what axes read more, f at their places by the motion of x (E-90).
ByErrors<MEASURED> by_errors(const StateVector& x, const Vector3& alpha, const Sensor& s) {
  const Vector3 omega = x.segment<3>(OMEGA), r = x.segment<3>(PIVOT), lift = x.segment<3>(LIFT);
  const Matrix3 spin = skew(omega), turn = product(spin, spin) + skew(alpha);
  ByErrors<MEASURED> Y(MEASURED, ERRORS_OF_AXIS * s.n);
  for (int i = 0; i < s.n; ++i) {
    const Vector3 place = s.r_b.row(i).transpose() + r, axis = s.theta_b.row(i).transpose();
    const Vector3 f = lift + product(turn, place);
    const Vector3 felt = ACROSS * f + (1.0 - ACROSS) * dot(f, axis) * axis;
    for (int k = 0; k < ERRORS_OF_AXIS; ++k) Y.col(ERRORS_OF_AXIS * i + k) = felt(k) * s.W.col(i);
  }
  return Y;
}

// Offsets at rest that no bias has are errors of what gravity reads like: their mean square, of 1. A
// scale that all axes have in common shows in gravity's size alone.
double too_large_for_biases(const Filter& f, const Sensor& s, const Tuning& t) {
  const Measurement offsets = biases_of(f.x);
  double sum = 0.0;
  for (int k = 0; k < BIASES; ++k)
    if (s.drift(k, k) > 0.0) sum += square(offsets(k)) / s.drift(k, k);
  const Vector3 up = f.x.segment<3>(LIFT) / GRAVITY;
  const double size = dot(up, Vector3(offsets.segment<3>(FORCE_M)));
  const double bias = t.bias * dot(up, Vector3(s.drift.block<3, 3>(FORCE_M, FORCE_M) * up));
  const double apart = std::max(sum / BIASES - BIASES_SURE * t.bias, square(size) - BIASES_SURE * bias);
  return std::max(0.0, apart) / square(GRAVITY);
}

}  // namespace

void Inexact::begin(const Filter& f, const Sensor& s) {
  const int n = ERRORS_OF_AXIS * s.n;
  by_.setZero(STATES, n);
  at_rest_.setZero(MEASURED, n);
  information_.setZero(n, n);
  told_.setZero(n);
  P_ = f.P;
  level_ = f.level;
}

void Inexact::observe(const Said& said) {
  if (!said.used) return;
  now_.sum += said.innovation;
  ++now_.samples;
}

// What the filter scales its biases by (E-37), these follow.
void Inexact::follow_biases(const Filter& f, bool turning) {
  for (int k = 0; k < MEASURED; ++k) {
    const int b = bias_state(k);
    if (!turning) {
      at_rest_.row(k) = by_.row(b);
    } else if (level_(k) > 0.0) {
      by_.row(b) = at_rest_.row(k) + std::sqrt(f.level(k) / level_(k)) * (by_.row(b) - at_rest_.row(k));
    }
  }
  level_ = f.level;
}

void Inexact::move(const Filter& f, const Sensor& s, const Tuning& t, const Stretch& stretch,
                   const ByErrors<MEASURED>& Y) {
  const double dt = stretch.dt * stretch.samples;
  const Along along = along_axis(f.omega(), stretch.fixed, stretch.turning);
  const Drive drive{stretch.mean.segment<3>(ALPHA_M), along, dt, stretch.turning, Vector3::Zero()};
  StateVector x = f.x;
  predict(x, P_, drive, s);
  x = f.x;
  const Transition F = gyrofree::rate::move(x, drive, s);
  const ByErrors<3> more = Y.middleRows<3>(ALPHA_M) - by_.middleRows<3>(BIAS_ALPHA);
  const ByErrors<3> omega = by_.middleRows<3>(OMEGA), lift = by_.middleRows<3>(LIFT);
  const ByErrors<3> middle = omega + F.back * more;
  by_.middleRows<3>(LIFT) = product(F.C, lift) + product(F.T, middle);
  by_.middleRows<3>(OMEGA) = product(F.A, omega) + product(F.D, more);
  if (!stretch.turning) return;
  P_.block<3, 3>(OMEGA, OMEGA) += stretch.dt * dt * (along.N * s.R_alpha * along.N);
  if (along.fixed) P_.block<3, 3>(OMEGA, OMEGA) += t.axis * dt * (Matrix3::Identity() - along.N);
}

// by -= gain of what the state says already of y less what y says.
template <int M>
void Inexact::absorb_errors(const Seen<M>& seen, const ByErrors<M>& E) {
  const Cholesky<Matrix<M>> factor(seen.C);
  if (!factor.positive) return;
  const ByErrors<M> gained = factor.solved(E);
  by_ += product(seen.PHt, gained);
  StateVector x = StateVector::Zero();
  Seen<M> expected = seen;
  expected.y.setZero();
  absorb(x, P_, expected, std::numeric_limits<double>::infinity());
}

void Inexact::learn(const ByErrors<6>& E) {
  if (now_.samples == 0) return;
  const Cholesky<Matrix<6>> factor(now_.C);
  if (!factor.positive) return;
  const ByErrors<6> white = factor.whitened(E);
  const Products said = factor.whitened(now_.sum);
  for (Eigen::Index j = 0; j < E.cols(); ++j) {
    told_(j) += dot(white.col(j), said);
    by_noise_ += now_.samples * square_of(white.col(j));
  }
  for (Eigen::Index j = 0; j < E.cols(); ++j)
    for (Eigen::Index i = 0; i < E.cols(); ++i) information_(i, j) += now_.samples * dot(white.col(i), white.col(j));
}

void Inexact::correct(const Filter& f, const Sensor& s, const Tuning& t, const Stretch& stretch,
                      const ByErrors<MEASURED>& Y) {
  const double share = 1.0 / stretch.samples;
  if (s.m > 0) {
    Seen<6> seen = see_products(P_, f.omega(), s, share);
    seen.C += product_transposed(product(s.M, spread_covariance(P_.block<3, 3>(OMEGA, OMEGA))), s.M);
    const Matrix<PRODUCTS, 3> H = products_model(f.omega(), s);
    const ByErrors<6> E = Y.middleRows<6>(PRODUCTS_M) - by_.middleRows<6>(BIAS_PRODUCTS) -
                          product(H, ByErrors<3>(by_.middleRows<3>(OMEGA)));
    now_.C = seen.C + (1.0 - share) * s.R_c;
    now_.by_errors = product_transposed(E, E);
    if (stretch.turning && settling_ == 0) learn(E);
    absorb_errors<6>(seen, E);
  }
  const Vector3 alpha = stretch.turning ? free_alpha(stretch.mean.segment<3>(ALPHA_M), f.x, s) : Vector3(Vector3::Zero());
  if (t.gravity_aid) {
    // as by_force(): noise of omega' in the Jacobian, which the filter does not follow, makes this diverge
    Vector3 late = Vector3::Zero();
    if (stretch.turning) late = f.alpha_late - f.x.segment<3>(BIAS_ALPHA);
    const ForceModel h = force_model(f.x, late, s);
    Seen<3> seen = see_force(f.x, P_, stretch.mean.segment<3>(FORCE_M), late, s, share);
    if (stretch.turning) {
      const double doubt = trace(P_.block<3, 3>(PIVOT, PIVOT));
      const double noise = (square_of(Vector3(f.x.segment<3>(PIVOT))) + 4.0 * doubt) * s.R_alpha(0, 0);
      for (int k = 0; k < 3; ++k) seen.C(k, k) += share * (t.centre + noise) + doubt * square_of(Vector3(alpha - late));
    }
    const ByErrors<3> omega = by_.middleRows<3>(OMEGA), pivot = by_.middleRows<3>(PIVOT);
    const ByErrors<3> E = Y.middleRows<3>(FORCE_M) - by_.middleRows<3>(LIFT) - by_.middleRows<3>(BIAS_FORCE) -
                          product(h.by_omega, omega) - product(h.by_pivot, pivot);
    absorb_errors<3>(seen, E);
  }
  if (stretch.turning) return;
  ByErrors<6> E = -by_.middleRows<6>(OMEGA);
  E.middleRows<3>(BIAS_ALPHA) += Y.middleRows<3>(ALPHA_M);
  absorb_errors<6>(see_standstill(P_, s, share * t.still_rate, share), E);
}

void Inexact::step(const Filter& f, const Sensor& s, const Tuning& t, const Stretch& stretch) {
  if (by_.cols() != Eigen::Index{ERRORS_OF_AXIS} * s.n) begin(f, s);
  const Vector3 alpha = stretch.turning ? free_alpha(stretch.mean.segment<3>(ALPHA_M), f.x, s) : Vector3(Vector3::Zero());
  const ByErrors<MEASURED> Y = by_errors(f.x, alpha, s);
  carried_ *= std::max(0.0, 1.0 - stretch.dt * stretch.samples / MEMORY_S);
  if (!stretch.turning || f.speed_squared() < t.axis_from)  // a slow body has only gravity to read
    settling_ = std::max(0, settling_ - (stretch.turning ? 1 : SETTLES / 8));
  if (stretch.turning) {
    const double kept = std::max(0.0, 1.0 - stretch.dt * stretch.samples / MEMORY_S);
    information_ *= kept;
    told_ *= kept;
    by_noise_ *= kept * kept;
  }
  if (!stretch.turning) by_offsets_ = too_large_for_biases(f, s, t);
  follow_biases(f, stretch.turning);
  move(f, s, t, stretch, Y);
  correct(f, s, t, stretch, Y);
  last_ = now_;
  now_ = Heard();
  P_ = f.P;
}

// Mean square of the errors by what innovations told, (|l|^2 - tr L) / |L|^2, and as much of what is
// expected as they left open.
double Inexact::by_innovations(double expected) const {
  double size = expected > 0.0 ? 1.0 / square(expected) : 0.0;
  double found = expected > 0.0 ? 1.0 / expected : 0.0;
  found += square_of(told_) - by_noise_;
  for (Eigen::Index j = 0; j < information_.cols(); ++j) size += square_of(information_.col(j));
  return size > 0.0 ? std::max(0.0, found / size) : 0.0;
}

double Inexact::beyond(const Tuning& t) const {
  const double expected = EXPECTED * std::min(t.scale, USUAL_SCALE);
  return std::max(0.0, FEW * std::max({carried_, by_offsets_, by_innovations(expected)}) - t.scale);
}

void Inexact::begin_anew() {
  const double carried = std::max(carried_, by_innovations(0.0));
  forget();
  carried_ = carried;
}

Matrix3 Inexact::unit_of_rate() const {
  Matrix3 sum = Matrix3::Zero();
  for (Eigen::Index j = 0; j < by_.cols(); ++j) {
    const Vector3 omega = by_.col(j).segment<3>(OMEGA);
    sum += omega * omega.transpose();
  }
  return sum;
}

}  // namespace gyrofree::rate
