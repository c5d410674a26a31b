// Other axes are in use from here on (E-42, E-89).
#include "rate/frame.hpp"

namespace gyrofree::rate {
namespace {

constexpr int STILL_STEPS = 100;  // of the standstill, at most, that tell the biases

}  // namespace

void Frame::exchange_axes(const Constants& configured, const Axes& axes) {
  watch_.unlearn();
  agreement_.forget();
  inexact_.forget();
  surprise_.forget();
  unproven_s_ = std::max(unproven_s_, PROOF_S);
  renewed_ = true;
  kept_.clear();
  arrivals_.clear();
  fitted_ = 0;
  against_s_ = 0.0;
  rest_from_ = -DEPTH;
  if (!started_) return since_rest_.forget();
  if (axes.fewer) return from_rest(believed(configured));
  since_rest_.forget();
  carry_biases(axes);
}

// What was known of the biases of the axes in use before is known of those now.
void Frame::carry_biases(const Axes& axes) {
  Covariance full = Covariance::Identity();
  for (int i = 0; i < MEASURED; ++i)
    for (int j = 0; j < MEASURED; ++j) full(bias_state(i), bias_state(j)) = axes.T(i, j);
  for (Start* begun : {&first_, &second_}) {
    Filter& f = begun->filter;
    f.x = product(full, f.x);
    f.P = product_transposed(product(full, f.P), full);
    symmetrise(f.P);
    add_to_biases(f.P, axes.unknown, 1.0);
    f.rest_bias = product(axes.T, f.rest_bias);
    f.rest_variance = f.level = bias_variances(f.P);
  }
}

// All that was made with an axis that cannot be believed is in doubt: the axes that stay are taken
// through the last standstill and what followed it. Without one the rate is unknown.
void Frame::from_rest(const Constants& c) {
  if (!since_rest_.known()) return restart();
  const SinceRest& past = since_rest_;
  const Block& rest = past.rest();
  const Measurement mean = c.sensor.measure(Vector<MOST_AXES>(rest.mean()).data());
  const double dt = rest.seconds / rest.samples;
  Filter& f = first_.filter;
  unproven_s_ = PROOF_S;
  begin_still(f, c.sensor, c.tuning, mean);
  f.q_nb = past.q_nb();
  f.x(ANGLE) = past.angle();
  f.P(ANGLE, ANGLE) = past.angle_variance();
  branches_ = 1;
  for (int k = std::min(STILL_STEPS, rest.samples); k > 0; --k) {
    const bool eighth = k % EVERY == 0;
    step(f, c.sensor, c.tuning, mean, {dt, false, false, eighth ? EVERY * dt : 0.0, nullptr}, said_);
    if (eighth) inexact_.step(f, c.sensor, c.tuning, {mean, dt, EVERY, false, false});
  }
  for (int k = 0; k < past.blocks(); ++k) {
    const Block& block = past.block(k);
    const Measurement y = c.sensor.measure(Vector<MOST_AXES>(block.mean()).data());
    step(f, c.sensor, c.tuning, y, {block.seconds, !still_, false, block.seconds, nullptr}, said_);
    inexact_.observe(said_);
    inexact_.step(f, c.sensor, c.tuning, {y, block.seconds, 1, !still_, false});
    surprise_.observe(inexact_.heard());
    trust(block.seconds);
  }
  if (still_ && !moved_) stay();
  diverged();
}

}  // namespace gyrofree::rate
