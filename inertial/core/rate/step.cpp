// One sample through a products filter: biases, prediction, corrections, navigation (E-30 to E-39).
#include "rate/filter.hpp"

namespace gyrofree::rate {
namespace {

constexpr double RATE_SURE = 16.0;          // of |omega|^2 over its variance: the sign is certain
constexpr double LATELY = 1.0 / 16.0;  // weight of one sample in the mean omega' that the pivot is told by

// Earth's rate in b, rad/s; zero unless asked for.
Vector3 earth_rate(const Filter& f, const Tuning& t) {
  if (t.earth_north == 0.0 && t.earth_down == 0.0) return Vector3::Zero();
  return to_matrix(f.q_nb).transpose() * Vector3(t.earth_north, 0.0, t.earth_down);
}

// Prediction by the filter's method, with noise. turning: the detector's word, drive.turning: omega' is
// integrated.
void predict_by_method(Filter& f, const Sensor& s, const Tuning& t, const Drive& drive, bool turning) {
  const auto method = static_cast<Method>(t.method);
  if (method == Method::UKF) {
    predict_unscented(f.x, f.P, drive, s);
  } else {
    predict(f.x, f.P, drive, s);
  }
  if (method == Method::FORGET && turning) {
    forget(f.P, s, t, t.forget * drive.dt);
  } else {
    add_noise(f.P, drive, s, t);
  }
}

// What omega' did between two samples is not known: when it changed by more than noise, the mean of the
// two is wrong by up to half of that (E-56).
void add_jolt(Filter& f, const Sensor& s, const Vector3& alpha_m, double dt) {
  constexpr double JOLT = 20.0;  // chi-square, 3 degrees
  const Vector3 change = alpha_m - f.alpha_m;
  double chi2 = 0.0;
  for (int k = 0; k < 3; ++k) chi2 += change(k) * change(k) / (2.0 * s.R_alpha(k, k));
  if (chi2 > JOLT) f.P.block<3, 3>(OMEGA, OMEGA) += 0.25 * dt * dt * (change * change.transpose());
}

Likelihood correct_by_products(Filter& f, const Sensor& s, const Tuning& t, const Measurement& y,
                               const Vector3* at, Said& said) {
  const Products c_m = y.segment<6>(PRODUCTS_M);
  if (static_cast<Method>(t.method) == Method::UKF) return by_products_unscented(f, c_m, s, t, said);
  return by_products(f, c_m, at == nullptr ? Vector3(f.omega()) : *at, s, t, said);
}

// Gravity, and standstill where there is one; then what of omega' is handed on.
Likelihood correct_by_rest(Filter& f, const Sensor& s, const Tuning& t, const Measurement& y, const Drive& drive,
                           bool turning) {
  Likelihood told{0.0, 1.0};
  const Vector3 alpha_m = y.segment<3>(ALPHA_M), bias = f.x.segment<3>(BIAS_ALPHA);
  if (t.gravity_aid) {
    told = by_force(f, y.segment<3>(FORCE_M), drive.alpha_m - bias, f.alpha_late - bias, turning, s, t);
  }
  if (!turning) by_standstill(f, alpha_m, drive.earth_b, s, t);
  f.alpha_late += LATELY * (f.alpha_m - f.alpha_late);
  f.alpha_m = alpha_m;
  return told;
}

// Variance of omega along itself for the question of its sign: products narrow it only where the sign
// is certain. They say the same of omega and -omega; only the integral through zero tells them apart
// (E-43).
void judge_sign(Filter& f, const Sensor& s, double dt, bool turning) {
  const Matrix3 P = f.omega_covariance();
  const Vector3 omega = f.omega();
  if (!turning) {
    f.sign_variance = largest_variance(P);
  } else if (f.speed_squared() > RATE_SURE * f.sign_variance) {
    f.sign_variance = dot(omega, P * omega) / f.speed_squared();
  } else {
    f.sign_variance += dt * dt * largest_variance(s.R_alpha);
  }
}

// q_nb turned so that up_b points up in n, of unit length; heading is kept (E-12).
Quaternion stand_up(const Quaternion& q, const Vector3& up_b) {
  const double size = norm_of(up_b);
  if (size == 0.0) return q;
  const Vector3 up_n = to_matrix(q) * up_b / size;
  return normalised(from_rotation_vector({-up_n.y(), up_n.x(), 0.0}) * q);
}

// Attitude by the mean rate, tilt by u; then velocity and position from f_b (E-12, E-13).
void navigate(Filter& f, const Vector3& mean_rate, const Vector3& f_b, const Drive& drive) {
  const double dt = drive.dt;
  const Vector3 turn = dt * (mean_rate - drive.earth_b);
  f.q_nb = stand_up(f.q_nb * from_rotation_vector(turn), f.x.segment<3>(LIFT));
  const Vector3 force_n = to_matrix(f.q_nb) * f_b + Vector3(0.0, 0.0, GRAVITY);
  const Vector3 v_n = f.v_n + 0.5 * dt * (f.force_n + force_n);
  f.p_n += 0.5 * dt * (f.v_n + v_n);
  f.v_n = v_n;
  f.force_n = force_n;
}

}  // namespace

void step(Filter& f, const Sensor& s, const Tuning& t, const Measurement& y, const Moment& moment, Said& said) {
  if (moment.grow > 0.0) grow_biases(f, s, t, moment);
  if (moment.forget > 0.0) forget(f.P, s, t, moment.forget * moment.dt);
  const StateVector x_before = f.x;
  const Covariance P_before = f.P;
  const Vector3 omega_before = f.omega();
  const bool fixed = moment.fixed && f.speed_squared() > t.axis_from;
  Drive drive{0.5 * (f.alpha_m + y.segment<3>(ALPHA_M)), along_axis(omega_before, fixed, moment.turning),
              moment.dt, moment.turning, earth_rate(f, t)};
  predict_by_method(f, s, t, drive, moment.turning);
  if (moment.turning) add_jolt(f, s, y.segment<3>(ALPHA_M), moment.dt);
  const Likelihood told = correct_by_products(f, s, t, y, moment.at, said);
  said.nis = told.nis;
  said.used = told.nis <= t.products_gate;
  Likelihood force{0.0, 1.0};
  Vector3 f_b;
  if (said.used) {
    force = correct_by_rest(f, s, t, y, drive, moment.turning);
    f_b = y.segment<3>(FORCE_M) - f.x.segment<3>(BIAS_FORCE);
  } else {  // a damaged sample: its omega' must not be integrated either
    f.x = x_before;
    f.P = P_before;
    drive.alpha_m = f.alpha_m;
    drive.turning = true;
    drive.along = along_axis(omega_before, fixed, true);
    predict_by_method(f, s, t, drive, moment.turning);
    f.P.block<3, 3>(OMEGA, OMEGA) += t.unseen_alpha * moment.dt * moment.dt * Matrix3::Identity();
    f_b = f.x.segment<3>(LIFT);
  }
  said.force_used = force.nis <= t.force_gate;
  said.misfit = std::min(said.nis, t.products_gate) + std::min(force.nis, t.force_gate);
  said.density = told.density * force.density;
  judge_sign(f, s, moment.dt, moment.turning);
  navigate(f, 0.5 * (omega_before + f.omega()), f_b, drive);
}

}  // namespace gyrofree::rate
