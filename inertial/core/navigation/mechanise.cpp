// The strapdown mechanisation over many samples, with the sums that the error model needs.
// Positions on the ellipsoid change little in half a second, so that the Earth's terms are carried to
// first order from the start of the interval (next terms below 1e-12): no trigonometry per sample.
#include <algorithm>

#include "common/rotation.hpp"
#include "navigation/local_earth.hpp"
#include "navigation/leg.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double SHAKE_MEMORY_S = 1.0;

// The Earth at the vehicle (E-117).
struct Here {
  double inverse_n, inverse_e;  // 1/m
  double gravity;               // m/s^2
  Vector3 omega_ie_n, omega_en_n;
};

Here earth_here(const LocalEarth& e, const Nominal& x) {
  const double dL = x.latitude - e.latitude, dh = x.height - e.height;
  const double sine = e.sine + e.cosine * dL, cosine = e.cosine - e.sine * dL;
  const double tangent = e.tangent + (1.0 + e.tangent * e.tangent) * dL;
  Here here;
  here.inverse_n = e.inverse_n - e.inverse_n * e.inverse_n * (dh + e.n_by_latitude * dL);
  here.inverse_e = e.inverse_e - e.inverse_e * e.inverse_e * (dh + e.e_by_latitude * dL);
  here.gravity = e.gravity + e.gravity_by_height * dh + e.gravity_by_latitude * dL;
  const double east = x.v_n[EAST] * here.inverse_e;
  here.omega_ie_n << earth::RATE * cosine, 0.0, -earth::RATE * sine;
  here.omega_en_n << east, -x.v_n[NORTH] * here.inverse_n, -east * tangent;
  return here;
}

// Exp(-u) C to second order, for the turn of n: 1e-6 rad a sample.
Matrix3 turned_against(const Vector3& u, const Matrix3& C) {
  const double half_square = 0.5 * square_of(u);
  Matrix3 out;
  for (int j = 0; j < 3; ++j) {
    const Vector3 c = C.col(j);
    out.col(j) = c - cross(u, c) + u * (0.5 * dot(u, c)) - half_square * c;
  }
  return out;
}

// Position by the mean velocity of the sample (E-105).
void move(Nominal& x, const LocalEarth& e, const Here& here, const Vector3& v_after, double dt) {
  const Vector3 mean = 0.5 * (x.v_n + v_after);
  const double latitude = x.latitude + mean[NORTH] * dt * here.inverse_n;
  const double half_way = 0.5 * (x.latitude + latitude) - e.latitude;
  x.longitude += mean[EAST] * dt * here.inverse_e / (e.cosine - e.sine * half_way);
  x.height -= mean[DOWN] * dt;
  x.latitude = latitude;
  x.v_n = v_after;
}

// One sample, or a part of it, of length dt (E-105).
void step(Nominal& x, OpenTick& tick, const LocalEarth& around, const Sample& sample, double dt) {
  const Vector3 f_b = sample.f_b - x.bias_accel - x.scale_accel.cwiseProduct(sample.f_b);
  const Vector3 omega_b = sample.omega_b - x.bias_gyro - x.scale_gyro.cwiseProduct(sample.omega_b);
  const Here here = earth_here(around, x);
  const Matrix3 before = x.C_nb;
  const Matrix3 turned = before * turn_matrix(omega_b * dt);
  const Matrix3 after = turned_against((here.omega_ie_n + here.omega_en_n) * dt, turned);
  const Matrix3 mean = 0.5 * (before + after);
  const Vector3 f_n = mean * f_b;
  Vector3 rate_of_v = f_n - cross(2.0 * here.omega_ie_n + here.omega_en_n, x.v_n);
  rate_of_v[DOWN] += here.gravity;

  tick.length += dt;
  tick.f_n += f_n * dt;
  tick.C_nb += mean * dt;
  tick.f_b += sample.f_b * dt;
  tick.omega_b += sample.omega_b * dt;
  move(x, around, here, x.v_n + rate_of_v * dt, dt);
  x.C_nb = after;
}

// g_i^2 <- g_i^2 + part (dt (u_k - u_(k-1))_i^2 / 2 - g_i^2) (E-131)
void follow(Vector3& density, const Vector3& change, double dt) {
  const double part = std::min(1.0, dt / SHAKE_MEMORY_S);
  density += part * (0.5 * dt * change.cwiseProduct(change) - density);
}

void look_at_shaking(Shake& shake, Samples samples, std::size_t k) {
  if (k > 0) {
    const double dt = samples[k].t - samples[k - 1].t;
    follow(shake.accel, samples[k].f_b - shake.last_f, dt);
    follow(shake.gyro, samples[k].omega_b - shake.last_omega, dt);
  }
  shake.last_f = samples[k].f_b;
  shake.last_omega = samples[k].omega_b;
}

void begin_shaking(Shake& shake, const Sample& sample) {
  shake.seen = true;
  shake.last_f = sample.f_b;
  shake.last_omega = sample.omega_b;
}

}  // namespace

std::size_t mechanise(Leg& leg, Samples samples, std::size_t start, std::size_t stop, double until) {
  std::size_t k = start;
  if (!leg.shake.seen && k < stop) begin_shaking(leg.shake, samples[k > 0 ? k - 1 : k]);
  if (leg.tick.length <= 0.0 && leg.interval.length <= 0.0)
    leg.earth = local_earth(leg.x.latitude, leg.x.height);
  while (k < stop) {
    const double end = std::min(samples[k].t, until);
    if (end > leg.time) {
      step(leg.x, leg.tick, leg.earth, samples[k], end - leg.time);
      leg.time = end;
    }
    if (samples[k].t > until) break;
    look_at_shaking(leg.shake, samples, k);
    ++k;
    if (leg.tick.length >= TICK_S - SLACK_S) break;
  }
  return k;
}

}  // namespace gyrofree::navigation
