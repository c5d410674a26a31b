#include "navigation/trial.hpp"

#include <algorithm>
#include <utility>

#include "common/elementary.hpp"

namespace gyrofree::navigation {
namespace {

constexpr int COMPARED = DP;         // attitude and velocity
constexpr double MOST_GAP_S = 2.0;   // between two fixes that counts as motion
constexpr double MOST_SQUARE = 25.0; // of one look: it must not be remembered for ever

// As the wheels' constraint sees it: below a speed, and backwards, it is silent.
double forward_speed(const Nominal& x) { return dot(Vector3(x.C_nb.col(0)), x.v_n); }

// The filter with wheels begins again from the one without.
void begin_again(Trial& trial, const Leg& without, double t) {
  trial.other = without;
  trial.other.wheels = true;
  trial.other.strain = 0.0;
  trial.difference = trial.agreement = 0.0;
  trial.begun = t;
}

// How long they have agreed, and through what turn.
void agree(Trial& trial, const Nominal& x, bool agrees, double dt) {
  Vector3 forward = x.C_nb.col(0);
  forward[DOWN] = 0.0;
  if (!agrees || trial.agreement <= 0.0) {
    trial.agreement = trial.turned = 0.0;
    trial.forward = forward;
  }
  if (!agrees) return;
  trial.agreement += dt;
  const double turned = elementary::atan2(norm_of(cross(trial.forward, forward)), dot(trial.forward, forward));
  trial.turned = std::max(trial.turned, turned);
}

void contradict(Trial& trial, Leg& leg, const TrialSettings& s, double t) {
  const bool believed = leg.wheels;
  if (!trial.doubted_before)
    trial.wanted = s.again;
  else if (believed)
    trial.wanted = std::min(2.0 * trial.wanted, s.most_again);
  trial.doubted_before = true;
  if (believed) std::swap(leg, trial.other);
  begin_again(trial, leg, t);
}

}  // namespace

void begin_trial(Trial& trial, Leg& leg, const TrialSettings& settings) {
  trial = Trial(leg.states());
  trial.running = true;
  trial.wanted = settings.proof;
  trial.last = leg.time;
  leg.wheels = false;
  begin_again(trial, leg, leg.time);
}

double difference_of(const State& with, const State& without, const TrialSettings& s) {
  // Exp(-(psi_with - psi_without)), small: half its skew part
  const Matrix3 turn = Matrix3(with.x.C_nb) * Matrix3(without.x.C_nb).transpose();
  Vector<COMPARED> d;
  d << 0.5 * (turn(2, 1) - turn(1, 2)), 0.5 * (turn(0, 2) - turn(2, 0)), 0.5 * (turn(1, 0) - turn(0, 1)),
      with.x.v_n - without.x.v_n;
  double sum = 0.0;
  for (int i = 0; i < COMPARED; ++i) {
    const double floor = i < DV ? s.floor_psi : s.floor_v;
    sum += d(i) * d(i) / (std::max(without.P(i, i) - with.P(i, i), 0.0) + floor * floor);
  }
  return sum / COMPARED;
}

bool judge_wheels(Trial& trial, Leg& leg, const TrialSettings& s, double t, const State& shown,
                  const State& other) {
  const bool believed = leg.wheels;
  const State &with = believed ? shown : other, &without = believed ? other : shown;
  const double strain = believed ? leg.strain : trial.other.strain;
  const bool lost = without.nis_per_row > std::max(s.lost, with.nis_per_row);
  if (lost || t - trial.last > s.outage) trial.settled = t + s.recovery;
  const double dt = std::min(t - trial.last, MOST_GAP_S);
  trial.last = t;
  if (t >= trial.settled && forward_speed(without.x) > s.least_speed) {
    const double now = std::min(difference_of(with, without, s), MOST_SQUARE);
    trial.difference += std::min(1.0, dt / s.memory) * (now - trial.difference);
    agree(trial, without.x, trial.difference < s.agreed, dt);
  }
  if (trial.difference > s.contradicted || strain > s.strain) {
    contradict(trial, leg, s, t);
    return believed;
  }
  const double yaw_variance = without.P(PSI + DOWN, PSI + DOWN);
  const bool seen = trial.turned >= s.turn && yaw_variance <= s.heading * s.heading;
  if (believed || trial.agreement < trial.wanted || !seen) return false;
  std::swap(leg, trial.other);
  return true;
}

Wheels wheels_of(const Trial& trial, const Leg& leg) {
  if (!trial.running) return Wheels::NONE;
  if (leg.wheels) return Wheels::BELIEVED;
  return trial.doubted_before ? Wheels::CONTRADICTED : Wheels::ON_TRIAL;
}

}  // namespace gyrofree::navigation
