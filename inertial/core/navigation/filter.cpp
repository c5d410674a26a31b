#include "navigation/filter.hpp"

#include <algorithm>
#include <cmath>

#include "common/elementary.hpp"
#include "navigation/local_earth.hpp"
#include "navigation/receiver.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double NOTHING = std::numeric_limits<double>::quiet_NaN();

// A course is the heading of the moment that the receiver's velocity is of.
double yaw_of_course(const Nominal& x, const Vector3& rate_b) {
  const Vector3 down_b = x.C_nb.row(DOWN).transpose();
  const double turn = dot(down_b, rate_b - x.bias_gyro) * x.lag_velocity;
  const Vector3 forward_n = x.C_nb.col(0);
  return elementary::atan2(forward_n[EAST], forward_n[NORTH]) - turn;
}

// What the fix says, before anything is done with it.
void say(FixResult& out, const Leg& leg, const Measurement& z, const RowMatrix& S, double nis,
         const Vector3& rate_b) {
  out.nis = nis;
  out.dof = z.rows();
  for (int i = 0; i < z.rows(); ++i) {
    if (is_silent(z, i)) continue;
    out.y(i) = z.y(i);
    out.sigma(i) = std::sqrt(S(i, i));
  }
  out.yaw = yaw_of_course(leg.x, rate_b);
  out.error_ned = out.y.segment<3>(POSITION_ROW);
  out.error_ned[DOWN] = -out.error_ned[DOWN];
}

void answer(FixResult& out, const Leg& leg, const Model& model, const Covariance& P, Status status) {
  out.status = status;
  out.x = leg.x;
  out.P = P.topLeftCorner<MOVING, MOVING>();
  tell_what_stays(out.P, model, leg.receiver.wander);
}

// Quiet readings are a standstill only where the fixes' velocities say so too (E-140).
void check_standstill(Leg& leg, const Fix& fix) {
  constexpr double SHARE = 0.2, MOST = 25.0, PLAIN = 6.0;  // PLAIN: one such fix is enough
  if (leg.quiet && fix.has_v) {
    double sum = 0.0;
    int known = 0;
    for (int i = 0; i < 3; ++i) {
      if (!std::isfinite(fix.v_n(i))) continue;
      ++known;
      sum += fix.v_n(i) * fix.v_n(i) / (leg.receiver.velocity * fix.sigma_v(i) * fix.sigma_v(i));
    }
    if (known > 0) {
      const double now = std::min(sum / known, MOST);
      leg.moved = now > PLAIN ? std::max(leg.moved, now) : leg.moved + SHARE * (now - leg.moved);
      if (leg.moved > MOST_MOVED) {  // that it stood was wrong, not the biases
        leg.receiver.lasting.setZero();
        leg.receiver.disagreement = 1.0;
      }
    }
  }
  leg.quiet = false;
}

// The error that all its fixes have in common for a while (E-138).
void remember_wander(Leg& leg, const Model& model, const Settings& s, const Fix& fix) {
  const double lag = model.has_lag() ? 0.0 : s.lag;
  for (int i = 0; i < 3; ++i) {
    const double slow = s.wander * fix.sigma_p(i), late = lag * leg.x.v_n(i);
    leg.receiver.wander(i) = leg.receiver.position * slow * slow + late * late;
  }
}

// Whether to refuse the fix. A robust filter that doubts fix after fix is as lost as one that refuses
// them. After `readmit` of either the filter is wrong, not the receiver.
Status judge(Memory& memory, const Settings& s, double nis, int rows, const Weights& weight) {
  const double lowest = std::min({weight(POSITION), weight(VELOCITY), weight(HEADING)});
  memory.doubted = lowest < s.low_weight ? memory.doubted + 1 : 0;
  if (!(nis <= s.gates[static_cast<std::size_t>(rows)]) || memory.doubted >= s.readmit) {
    ++memory.refused;
    if (memory.refused < s.readmit && memory.doubted < s.readmit) return Status::REJECTED;
    memory.doubted = 0;
    return Status::READMITTED;
  }
  return lowest < 1.0 ? Status::DOUBTED : Status::USED;
}

// How many fixes to look back, by the settings or by the fuzzy rules.
int horizon_of(FixResult& out, const Leg& leg, const Settings& s, const Memory& memory) {
  out.crisp = s.horizon;
  if (s.horizon != 0) return s.horizon;
  out.inputs = motion(leg, s.literal, memory.still_f);
  out.crisp = crisp_horizon(out.inputs(0), out.inputs(1), s.fuzzy);
  return whole_horizon(out.crisp);
}

// Solves the horizon that ends with this fix; returns the estimate, P becomes its covariance.
StateVector look_back(FixResult& out, const Leg& leg, const Settings& s, Memory& memory, const Measurement& z,
                      Covariance& P) {
  Window& window = memory.window;
  const bool own = s.window == Horizon::ROBUST;
  window.push(leg.Phi, leg.Q, z, own ? leg.P : window.kalman);
  const int N = horizon_of(out, leg, s, memory);
  const Covariance P_arr = window.arrival(N, own ? Arrival::KALMAN : s.arrival, s.kappa);
  out.horizon = std::min(N, window.count);
  if (own) {
    window.robust(out.horizon, P_arr, s.huber, s.passes);
    out.weight = window.newest().scale;
  } else {
    window.forward(out.horizon, P_arr);
    window.kalman_beside();
  }
  P = window.newest().P_after;
  window.newest().applied = window.newest().after;
  return window.newest().after;
}

// Position and velocity of the fix against the corrected state.
Vector<6> left_after(const Leg& leg, const Model& model, const Settings& s, const Fix& fix,
                     const Vector3& rate_b) {
  Vector<6> left = compared(leg, model, rate_b, s.lever_b, fix).y.head<HEADING_ROW>();
  if (!fix.has_v) left.segment<3>(VELOCITY_ROW).setConstant(NOTHING);
  return left;
}

}  // namespace

FixResult::FixResult() {
  nis = crisp = yaw = NOTHING;
  inputs.setConstant(NOTHING);
  y.setConstant(NOTHING);
  sigma.setConstant(NOTHING);
  weight.setOnes();
  error_ned.setConstant(NOTHING);
  left.setConstant(NOTHING);
  P.setConstant(NOTHING);
}

std::size_t run_to(Leg& leg, const Model& model, const Rules& rules, Samples samples, std::size_t start,
                   std::size_t stop, double until) {
  std::size_t k = start;
  StateVector error;
  while (k < stop) {
    k = run_leg(leg, model, samples, k, stop, until, rules.every);
    if (leg.since_constraint >= rules.every - SLACK_S) {
      constrain(leg, model, rules, error);
      leg.since_constraint = 0.0;
    } else if (k < stop && samples[k].t > until && leg.time >= until) {
      break;
    }
  }
  return k;
}

FixResult take(Leg& leg, const Model& model, const Settings& s, Memory& memory, const Fix& fix,
               const Vector3& rate_b) {
  close(leg, model);
  Covariance P = predicted(leg.P, leg.Phi, leg.Q, s.fading);
  Measurement z = chosen(compared(leg, model, rate_b, s.lever_b, fix), fix);
  raise(z, leg.receiver);
  Innovation innovation = innovate(P, z);
  Whitened white = whiten(innovation.S, z.y);
  FixResult out;
  say(out, leg, z, innovation.S, white.nis, rate_b);
  answer(out, leg, model, P, Status::WITHHELD);
  if (fix.withheld) return out;

  learn(leg.receiver, z, innovation.S, s.adapt);
  check_standstill(leg, fix);
  const bool weighs = s.huber < FOREVER && s.window == Horizon::NONE;
  const Weights weight = weighs ? huber_weights(innovation.S, z.y, s.huber) : Weights(Weights::Ones());
  const Status status = judge(memory, s, white.nis, said_rows(z), weight);
  out.status = status;
  if (status == Status::REJECTED) return out;
  if (status == Status::READMITTED) {  // believe less of the filter, and nothing of what its horizon holds
    make_consistent(P, z);
    innovation = innovate(P, z);
    memory.window.count = 0;
  } else if (status == Status::DOUBTED) {
    inflate(innovation.S, z.R, weight);
    out.weight = weight;
  }
  memory.refused = 0;
  if (s.window == Horizon::NONE || status == Status::READMITTED) {
    memory.estimate = absorb(P, innovation, whiten(innovation.S, z.y));
    memory.window.kalman = P;
  } else {
    memory.estimate = look_back(out, leg, s, memory, z, P);
  }
  leg.P = P;
  correct(leg, model, memory.estimate);
  remember_wander(leg, model, s, fix);
  out.left = left_after(leg, model, s, fix, rate_b);
  answer(out, leg, model, P, status);
  return out;
}

// Conditioned: means over the last second, gyro bias off, and g plus how far |mean f| is from its value
// at standstill. Literal: of the last tick, as read.
Vector<2> motion(const Leg& leg, bool literal, double still_f) {
  Vector3 f = Vector3::Zero(), omega = Vector3::Zero();
  double T = 0.0;
  for (int k = TICKS - (literal ? 1 : TICKS_A_SECOND); k < TICKS; ++k) {
    T += leg.ticks[k].length;
    f += leg.ticks[k].f_b;
    omega += leg.ticks[k].omega_b;
  }
  if (T <= 0.0) return {earth::STANDARD_GRAVITY, 0.0};
  const double size = norm_of(f / T);
  if (literal) return {size, norm_of(omega / T)};
  return {earth::STANDARD_GRAVITY + std::fabs(size - still_f), norm_of(omega / T - leg.x.bias_gyro)};
}

void begin_trial(Leg& leg, const Settings& settings, Memory& memory) {
  if (settings.tries && !memory.trial.running) begin_trial(memory.trial, leg, settings.trial);
}

std::size_t run_both(Leg& leg, const Model& model, const Settings& settings, Memory& memory, Samples samples,
                     std::size_t start, std::size_t stop) {
  if (memory.trial.running) run_to(memory.trial.other, model, settings.rules, samples, start, stop, FOREVER);
  return run_to(leg, model, settings.rules, samples, start, stop, FOREVER);
}

namespace {

// Sample k is the one that reaches over the fix.
FixResult take_one(Leg& leg, const Model& model, const Settings& settings, Memory& memory, Samples samples,
                   std::size_t k, std::size_t stop, const Fix& fix) {
  open_biases(leg, settings.jump_accel, settings.jump_gyro);
  Leg trial = leg;
  run_to(trial, model, settings.rules, samples, k, std::min(k + 1, stop), fix.t);
  FixResult out = take(trial, model, settings, memory, fix, samples[std::min(k, stop - 1)].omega_b);
  if (was_used(out.status))
    leg = trial;
  else
    leg.receiver = trial.receiver, leg.moved = trial.moved, leg.quiet = trial.quiet;
  return out;
}

State state_of(const FixResult& said) { return {said.x, said.P, said.nis / std::max(said.dof, 1)}; }

// The same of the filter beside it, which counts its own refusals.
FixResult take_other(const Model& model, const Settings& settings, Memory& memory, Samples samples,
                     std::size_t k, std::size_t stop, const Fix& fix) {
  Trial& trial = memory.trial;
  std::swap(memory.refused, trial.refused), std::swap(memory.doubted, trial.doubted);
  FixResult out = take_one(trial.other, model, settings, memory, samples, k, stop, fix);
  std::swap(memory.refused, trial.refused), std::swap(memory.doubted, trial.doubted);
  return out;
}

}  // namespace

FixResult take_at(Leg& leg, const Model& model, const Settings& settings, Memory& memory, Samples samples,
                  std::size_t& k, std::size_t stop, const Fix& fix) {
  std::size_t end = k;
  while (end < stop && samples[end].t <= fix.t) ++end;
  k = run_both(leg, model, settings, memory, samples, k, end);
  Trial& trial = memory.trial;
  FixResult other;
  if (trial.running) other = take_other(model, settings, memory, samples, k, stop, fix);
  FixResult out = take_one(leg, model, settings, memory, samples, k, stop, fix);
  if (!trial.running) return out;
  const FixResult& without = leg.wheels ? other : out;
  if (was_used(without.status) && judge_wheels(trial, leg, settings.trial, fix.t, state_of(out), state_of(other))) {
    std::swap(memory.refused, trial.refused), std::swap(memory.doubted, trial.doubted);
    out = other;
    out.switched = 1;
  }
  out.wheels = wheels_of(trial, leg);
  out.difference = trial.difference;
  return out;
}

std::vector<FixResult> run(Leg& leg, const Model& model, const Settings& settings, Memory& memory,
                           Samples samples, std::size_t start, std::size_t stop, std::span<const Fix> fixes) {
  begin_trial(leg, settings, memory);
  std::vector<FixResult> out(fixes.size());
  std::size_t k = start;
  for (std::size_t j = 0; j < fixes.size(); ++j) {
    if (fixes[j].t < leg.time - SAME_TIME_S) continue;  // late
    out[j] = take_at(leg, model, settings, memory, samples, k, stop, fixes[j]);
  }
  run_both(leg, model, settings, memory, samples, k, stop);
  return out;
}

}  // namespace gyrofree::navigation
