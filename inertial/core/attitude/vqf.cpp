#include "attitude/vqf.hpp"

#include <algorithm>

namespace gyrofree::attitude {
namespace {

constexpr double DEGREE = 3.14159265358979311600 / 180.0;  // rad
constexpr double ROOT2 = 1.41421356237309504880;
constexpr double PER_DEGREE = 100.0;  // units of P's root in one degree a second

double square(double x) { return x * x; }

Vector3 clipped(const Vector3& v, double most) {
  Vector3 out = v;
  for (const Axis i : {X, Y, Z}) out(i) = std::min(std::max(v(i), -most), most);
  return out;
}

double growth(double period) { return square(0.1 * PER_DEGREE) * period / Vqf::SETTINGS.forgetting_s; }

// Noise of a measurement with which the sigma of the bias settles at the given one.
double noise_for(double sigma, double period) {
  const double p = square(sigma * PER_DEGREE);
  return p * p / growth(period) + p;
}

}  // namespace

// With a time constant below half a period there is nothing to smooth: as it comes (E-79d).
Butterworth::Butterworth(double tau, double period) {
  if (tau < 0.5 * period) return;
  const double C = elementary::tan(0.5 * ROOT2 * period / tau);
  const double D = C * C + ROOT2 * C + 1.0;
  b0 = b2 = C * C / D;
  b1 = 2.0 * b0;
  a1 = 2.0 * (C * C - 1.0) / D;
  a2 = (1.0 - ROOT2 * C + C * C) / D;
}

Vqf::Vqf(double period)
    : period(period),
      smooth(SETTINGS.tau_accel, period),
      smooth_rest(SETTINGS.tau_rest, period),
      P(square(SETTINGS.sigma_first * PER_DEGREE) * Matrix3::Identity()) {}

Quaternion Vqf::step(const Vector3& f_b, const Vector3& omega_b) {
  watch_rate(omega_b);
  q_gb = normalised(q_gb * from_rotation_vector(period * (omega_b - bias_b)));  // (E-79c)
  if (square_of(f_b) > 0.0) {  // else there is no direction
    watch_force(f_b);
    estimate_bias(incline(f_b));
  }
  const Quaternion q = q_eg * q_gb;
  const double k = std::sqrt(0.5);  // q_ne = (0, 1, 1, 0) / sqrt(2): swaps x and y, turns z down
  return {k * (-q.x - q.y), k * (q.w + q.z), k * (q.w - q.z), k * (q.y - q.x)};
}

// A rate that deviates from its mean, or a mean that is no bias, ends rest (E-79i).
void Vqf::watch_rate(const Vector3& omega_b) {
  mean_omega_b = rest_omega.step(omega_b, smooth_rest, SETTINGS.tau_rest, period);
  const double most = SETTINGS.bias_most * DEGREE;
  const bool turning = std::fabs(mean_omega_b.x()) > most || std::fabs(mean_omega_b.y()) > most ||
                       std::fabs(mean_omega_b.z()) > most;
  if (turning || square_of(omega_b - mean_omega_b) >= square(SETTINGS.rest_omega * DEGREE)) {
    rested = 0.0;
    resting = false;
  }
}

void Vqf::watch_force(const Vector3& f_b) {
  const Vector3 mean = rest_f.step(f_b, smooth_rest, SETTINGS.tau_rest, period);
  if (square_of(f_b - mean) >= square(SETTINGS.rest_f)) {
    rested = 0.0;
    resting = false;
    return;
  }
  rested += period;
  if (rested >= SETTINGS.rest_s) resting = true;
}

// Corrects the inclination; returns up as it was in e before (E-79e).
Vector3 Vqf::incline(const Vector3& f_b) {
  const Vector3 f_e = rotate(q_eg, f_g.step(rotate(q_gb, f_b), smooth, SETTINGS.tau_accel, period));
  const double size = norm_of(f_e);
  Vector3 up_e = size > 0.0 ? Vector3(f_e / size) : f_e;
  const double w = std::sqrt((up_e.z() + 1.0) / 2.0);
  Quaternion turn{0.0, 1.0, 0.0, 0.0};  // upside down: any horizontal axis will do
  if (w > 1e-6) turn = {w, 0.5 * up_e.y() / w, -0.5 * up_e.x() / w, 0.0};
  q_eg = normalised(turn * q_eg);
  return up_e;
}

// Bias by the corrections of the inclination, or by the mean rate at rest (E-79f, E-79g).
void Vqf::estimate_bias(const Vector3& up_e) {
  const Matrix3 C = to_matrix(q_eg * q_gb);
  Vector<9> rows;
  rows << C.row(X).transpose(), C.row(Y).transpose(), C.row(Z).transpose();
  const Vector<9> smoothed = C_eb.step(rows, smooth, SETTINGS.tau_accel, period);
  const Vector3 biased = apply(C, bias_b);
  const Vector<2> mean_e =
      bias_e.step({biased.x(), biased.y()}, smooth, SETTINGS.tau_accel, period);
  if (resting) {
    const double noise = noise_for(SETTINGS.sigma_rest, period);
    correct_bias(Matrix3::Identity(), mean_omega_b - bias_b, {noise, noise, noise});
    return;
  }
  Matrix3 H;
  H.row(X) = smoothed.segment<3>(0);
  H.row(Y) = smoothed.segment<3>(3);
  H.row(Z) = smoothed.segment<3>(6);
  const Vector3 felt(-up_e.y() / period + mean_e.x(), up_e.x() / period + mean_e.y(), 0.0);
  const double noise = noise_for(SETTINGS.sigma_motion, period);
  correct_bias(H, felt - apply(H, bias_b), {noise, noise, noise / SETTINGS.vertical_part});
}

// Kalman filter of the bias (E-79h).
void Vqf::correct_bias(const Matrix3& H, const Vector3& misfit, const Vector3& noise) {
  const double most = SETTINGS.bias_most * DEGREE;
  for (const Axis i : {X, Y, Z})
    if (P(i, i) < square(SETTINGS.sigma_first * PER_DEGREE)) P(i, i) += growth(period);
  const Matrix3 HP = product(H, P);
  Matrix3 S = product_transposed(HP, H);
  S.diagonal() += noise;
  const Cholesky<Matrix3> factor(S);
  if (!factor.positive) return;
  const Matrix3 K_T = factor.solved(HP);
  bias_b = clipped(bias_b + apply(K_T.transpose(), clipped(misfit, most)), most);
  P -= product(K_T.transpose(), HP);
}

}  // namespace gyrofree::attitude
