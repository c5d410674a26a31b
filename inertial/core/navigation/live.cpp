#include "navigation/live.hpp"

#include <algorithm>

#include "common/rotation.hpp"
#include "navigation/receiver.hpp"

namespace gyrofree::navigation {
namespace {

constexpr std::size_t BEFORE_ANCHOR = 2;      // samples that the first one after the anchor looks at
constexpr std::size_t DROPPED_AT_ONCE = 512;  // so that dropping costs nothing per sample

}  // namespace

void Live::feed(Samples samples) {
  for (const Sample& sample : samples) {
    keep(sample);
    if (!navigating) continue;
    head_next = run_to(head, model, settings.rules, history, head_next, history.size(), FOREVER);
    follow();
  }
}

// Brings the anchor within reach: fixes older than two seconds come too late.
void Live::follow() {
  const double until = history.back().t - LATEST_S;
  if (anchor.time >= until - ANCHOR_STEP_S) return;
  anchor_next = run_both(anchor, model, settings, memory, history, anchor_next, after(until));
}

void Live::keep(const Sample& sample) {
  if (navigating && anchor_next > BEFORE_ANCHOR + DROPPED_AT_ONCE) drop(anchor_next - BEFORE_ANCHOR);
  if (!navigating && history.size() == MOST_SAMPLES) drop(MOST_SAMPLES - KEPT_SAMPLES);
  history.push_back(sample);
}

void Live::drop(std::size_t count) {
  history.erase(history.begin(), history.begin() + static_cast<std::ptrdiff_t>(count));
  anchor_next -= std::min(anchor_next, count);
  head_next -= std::min(head_next, count);
}

void Live::begin(const Leg& leg, const Memory& start) {
  anchor = leg;
  memory = start;
  begin_trial(anchor, settings, memory);
  head = anchor;
  navigating = true;
  anchor_next = head_next = after(leg.time);
  head_next = run_to(head, model, settings.rules, history, head_next, history.size(), FOREVER);
}

void Live::stop() {
  navigating = false;
  history.clear();
  anchor_next = head_next = 0;
}

bool Live::too_late(double t) const { return t < anchor.time - SAME_TIME_S; }

// A fix that is not used moves the anchor too, up to it; the head is then as it was, but for biases that
// opened.
FixResult Live::take(const Fix& fix) {
  FixResult out = take_at(anchor, model, settings, memory, history, anchor_next, history.size(), fix);
  if (!was_used(out.status) && out.switched == 0 && !surely_wrong(anchor.receiver)) return out;
  head = anchor;
  const std::size_t k = anchor_next;
  head_next = run_to(head, model, settings.rules, history, k, history.size(), FOREVER);
  return out;
}

std::size_t Live::after(double t) const {
  const auto later = std::upper_bound(history.begin(), history.end(), t,
                                      [](double time, const Sample& sample) { return time < sample.t; });
  return static_cast<std::size_t>(later - history.begin());
}

Matrix3 Live::turned_back(const Matrix3& C_nb, const Vector3& bias_gyro, double t) const {
  Matrix3 C = C_nb;
  for (std::size_t i = history.size(); i-- > after(t);) {
    const double begin = i > 0 ? std::max(t, history[i - 1].t) : t;
    C = C * turn_matrix((bias_gyro - history[i].omega_b) * (history[i].t - begin));
  }
  return C;
}

}  // namespace gyrofree::navigation
