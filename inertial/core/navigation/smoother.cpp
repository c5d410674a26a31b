#include "navigation/smoother.hpp"

#include <algorithm>

#include "navigation/receiver.hpp"

namespace gyrofree::navigation {
namespace {

using Kept = Eigen::MatrixXd;  // on the heap: an hour has ten thousand events

struct Event {
  Transition Phi;         // since the event before
  Kept before, after;     // covariance before and after what was measured; `after` becomes the smoothed
  StateVector applied;    // the correction
  Nominal x;              // after it; becomes the smoothed
  Vector3 wander;         // m^2, of the receiver's position (E-138)
  StateVector error;      // left in the filter's solution

  Event(const Leg& leg, const Model& model)
      : Phi(leg.Phi),
        before(predicted(leg.P, leg.Phi, leg.Q)),
        after(before),
        applied(StateVector::Zero(model.states)),
        x(leg.x),
        wander(leg.receiver.wander),
        error(StateVector::Zero(model.states)) {}
};

struct Compared {
  std::size_t event;
  Measurement z;
};

// Where the wheels may be used.
struct Span {
  double begin, end;  // s
};

constexpr double UNTOLD_S = 20.0;  // of a contradiction, before it is found: not used either

// The spans in which a filter that tries the wheels believes them, from where their trial began: what
// was found later to hold, held then. Without a trial: always.
std::vector<Span> believed(Leg leg, const Model& model, const Settings& settings, Memory memory, Samples samples,
                           std::size_t start, std::size_t stop, std::span<const Fix> fixes) {
  if (!settings.tries) return {{-FOREVER, FOREVER}};
  std::vector<Span> out;
  begin_trial(leg, settings, memory);
  std::size_t k = start;
  for (const Fix& fix : fixes) {
    if (fix.t < leg.time - SAME_TIME_S) continue;  // late
    const double begun = memory.trial.begun;
    const FixResult said = take_at(leg, model, settings, memory, samples, k, stop, fix);
    if (said.switched == 0) continue;
    if (said.wheels == Wheels::BELIEVED)
      out.push_back({begun, FOREVER});
    else
      out.back().end = fix.t - UNTOLD_S;
  }
  return out;
}

struct Forward {
  Leg& leg;
  const Model& model;
  const Settings& settings;
  Memory& memory;
  Samples samples;
  std::size_t stop;
  std::vector<Span> wheels;
  std::vector<Event> events;
  std::vector<Compared> fixes;

  // A constraint that is due; an event where it held.
  void constraint_due() {
    close(leg, model);
    Event event(leg, model);
    leg.wheels = std::any_of(wheels.begin(), wheels.end(), [this](const Span& span) {
      return leg.time >= span.begin && leg.time <= span.end;
    });
    if (!constrain(leg, model, settings.rules, event.applied)) return;
    event.after = leg.P;
    event.x = leg.x;
    events.push_back(event);
  }

  std::size_t run_to_fix(std::size_t k, double t) {
    const double every = settings.rules.every;
    for (;;) {
      k = run_leg(leg, model, samples, k, stop, t, every);
      if (leg.since_constraint < every - SLACK_S) return k;
      constraint_due();
      leg.since_constraint = 0.0;
      if (leg.time >= t - SAME_TIME_S || k >= stop) return k;
    }
  }

  void fix(const Fix& fix, const Vector3& rate_b) {
    open_biases(leg, settings.jump_accel, settings.jump_gyro);
    close(leg, model);
    Event event(leg, model);
    fixes.push_back({events.size(), compared(leg, model, rate_b, settings.lever_b, fix)});
    if (was_used(take(leg, model, settings, memory, fix, rate_b).status)) {
      event.applied = memory.estimate;
      event.x = leg.x;
      event.wander = leg.receiver.wander;
    } else {  // a new leg begins all the same
      leg.P = event.before;
      leg.Phi.set_identity();
      leg.Q.setZero();
    }
    event.after = leg.P;
    events.push_back(event);
  }
};

// G = P_e Phi^T (P-_(e+1))^-1, dx_e = G (c_(e+1) + dx_(e+1)), P_s = P_e + G (P_s - P-)_(e+1) G^T (E-126)
void backward(std::vector<Event>& events, const Model& model) {
  for (std::size_t e = events.size(); e-- > 1;) {
    const Event& later = events[e];
    Event& event = events[e - 1];
    Kept carried_over = later.Phi.decay.asDiagonal() * event.after;
    carried_over.topRows<MOVING>() = product(later.Phi.upper, event.after);
    const Kept G = Cholesky<Kept>(later.before).solved(carried_over).transpose();
    event.error = product(G, later.applied + later.error);
    const Kept change = product_transposed(product(G, later.after - later.before), G);
    event.after += 0.5 * (change + change.transpose());
    reset(event.x, event.error, model);
  }
}

}  // namespace

std::vector<Smoothed> smooth(Leg leg, const Model& model, const Settings& settings, Memory memory,
                             Samples samples, std::size_t start, std::size_t stop, std::span<const Fix> fixes) {
  const auto wheels = believed(leg, model, settings, memory, samples, start, stop, fixes);
  Forward pass{leg, model, settings, memory, samples, stop, wheels, {}, {}};
  std::size_t k = start;
  for (const Fix& fix : fixes) {
    k = pass.run_to_fix(k, fix.t);
    pass.fix(fix, samples[std::min(k, stop - 1)].omega_b);
  }
  backward(pass.events, model);
  std::vector<Smoothed> out(fixes.size());
  for (std::size_t j = 0; j < fixes.size(); ++j) {
    const auto& [at, z] = pass.fixes[j];
    const Event& event = pass.events[at];
    const StateVector error = event.applied + event.error;
    out[j] = {z.y - product(z.H, error), event.x, event.after.topLeftCorner<MOVING, MOVING>()};
    tell_what_stays(out[j].P, model, event.wander);
  }
  return out;
}

}  // namespace gyrofree::navigation
